function result = estimate(experiment, varargin)
%KALMEMS.ESTIMATE Estimate the motion of a device from a recording.
%   RESULT = KALMEMS.ESTIMATE(EXPERIMENT) estimates what the experiment file EXPERIMENT says, from the recordings that it names.
%
%   RESULT = KALMEMS.ESTIMATE(EXPERIMENT, RECORDING) takes the numbers of RECORDING in the place of the file that the experiment names.
%   RECORDING is a structure or a table of vectors of one length. A unit is the end of a name, as in a file: RECORDING.cap_V,
%   RECORDING.time_us. What is NaN is missing. Nothing is repaired: what is wrong with the samples is in RESULT.metrics.
%
%   RESULT = KALMEMS.ESTIMATE(..., NAME, VALUE) takes further
%      'Units'      a structure: the unit of a column whose name does not say it, struct('cap', 'V')
%      'Rate'       the sampling rate in Hz, where the experiment does not say it
%      'Clock'      the name of the column with the times, likewise
%      'Segments'   the name of the column that tells several records apart
%      'Reference'  a structure or a table of reference values, in the place of the file of the reference
%      'Recording'  the name or the role of the recording that is given, where the experiment has several
%      'Folder'     where to write report, trajectories and metrics, as the command kalmems does
%      'Force'      true to replace what is in that folder
%
%   RESULT has the fields
%      metrics       all figures, as metrics.json has them: errors, mean NIS, verdicts, tests, parameters
%      summary       the tables of the command as text
%      notices       a cell array of sentences to read before trusting a figure
%      trajectories  a structure array, one element for each filter and each segment: name, kind ('model', 'lock_in', 'filtered',
%                    'smoothed'), recording, segment, passes (whether no test contradicts the claims of the filter; false where it makes none), grade ('passes',
%                    'passes_with_remarks', 'doubtful', 'failed', 'no_estimate', or 'no_claim'), units, and the
%                    columns in SI as fields: time, the states (angle in rad, rate in rad/s) each with its standard deviation
%                    (angle_sd), measured, innovation, innovation_sd, nis, log_likelihood
%
%   Errors have the identifiers kalmems:experiment, kalmems:recording, kalmems:estimation and kalmems:argument.
%
%   Example
%      recording = struct('time_us', t, 'drive_V', u, 'cap_V', y);
%      result = kalmems.estimate('my_scanner.toml', recording);
%      best = result.trajectories(end);
%      plot(best.time, best.angle * 180/pi)
%
%   See also KALMEMS.REPORT, KALMEMS.VERSION.
[recordings, references, options] = kalmems.internal.given(varargin{:});
found = kalmems_gateway('estimate', kalmems.internal.text(experiment), recordings, references, ...
    char(options.Folder), double(options.Force));
result = struct('metrics', jsondecode(found.metrics), 'summary', found.summary, 'notices', {found.notices}, 'trajectories', []);
made = cell(1, numel(found.trajectories));
for k = 1:numel(found.trajectories)
    one = found.trajectories(k);
    trajectory = struct('name', one.name, 'kind', one.kind, 'recording', one.recording, 'segment', one.segment, ...
        'passes', one.passes, 'grade', one.grade, 'units', struct());
    for i = 1:numel(one.names)
        trajectory.(one.names{i}) = one.columns{i};
        trajectory.units.(one.names{i}) = one.units{i};
    end
    made{k} = trajectory;
end
result.trajectories = kalmems.internal.joined(made);
end
