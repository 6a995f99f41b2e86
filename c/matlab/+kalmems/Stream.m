classdef Stream < handle
%KALMEMS.STREAM Estimate samples while they arrive.
%   S = KALMEMS.STREAM(EXPERIMENT) begins to estimate samples as the table [stream] of the experiment says, and S = KALMEMS.STREAM(EXPERIMENT, STATE)
%   goes on from a file of its state, and leaves it there.
%
%   S.PUSH(SAMPLES) hands samples over: a matrix with a row for each and the columns of stream.input.text, or bytes as uint8.
%   ITEMS = S.POLL(TIMEOUT) is a structure array of estimates and events; it waits for the first one no longer than TIMEOUT in s, 0 if left out.
%   An estimate has of (the filter), time in s, and numbers with fields such as angle_rad and angle_sd_rad. An event has data.
%   S.FINISH() says that no more samples come, and returns all that is left; S.summary is then what came of the stream, with its health.
%   DELETE(S) stops the work.
%
%   Example
%      s = kalmems.Stream('my_stream.toml');
%      s.push([time, drive, signal]);
%      for item = s.poll(), disp(item), end
%
%   See also KALMEMS.ESTIMATE.
    properties (SetAccess = private)
        summary = [];
        ended = false;
    end
    properties (Access = private)
        number = 0;
    end
    methods
        function s = Stream(experiment, state)
            if nargin < 2
                state = '';
            end
            s.number = kalmems_gateway('stream_open', kalmems.internal.text(experiment), char(kalmems.internal.text(state)));
        end

        function push(s, samples)
            if isa(samples, 'uint8')
                kalmems_gateway('stream_push', s.number, samples);
            else
                kalmems_gateway('stream_push', s.number, double(full(samples)).');
            end
        end

        function items = poll(s, timeout)
            if nargin < 2
                timeout = 0;
            end
            found = kalmems_gateway('stream_poll', s.number, double(timeout), 1e6);
            if found.ended
                s.ended = true;
                s.summary = jsondecode(found.summary);
            end
            items = kalmems.internal.items(found.items(1:found.count));
        end

        function items = finish(s)
            kalmems_gateway('stream_close', s.number);
            all = {};
            while ~s.ended
                all{end + 1} = s.poll(1); %#ok<AGROW>
            end
            items = [all{:}];
        end

        function delete(s)
            if s.number > 0
                kalmems_gateway('stream_free', s.number);
                s.number = 0;
            end
        end
    end
end
