function files = export(experiment, folder, varargin)
%KALMEMS.EXPORT Write a filter as source for a microcontroller.
%   FILES = KALMEMS.EXPORT(EXPERIMENT, FOLDER) writes the source in C into a folder that exists, and returns the paths of its files.
%
%   FILES = KALMEMS.EXPORT(..., NAME, VALUE) takes further
%      'Filter'    the name of the filter; the first one that can be exported if left out
%      'Language'  'c' or 'rust'
%      'Rate'      the sampling rate in Hz; that of the recording if left out
%
%   See also KALMEMS.ESTIMATE.
[~, ~, options] = kalmems.internal.given(varargin{:});
languages = {'c', 'rust'};
if ~any(strcmp(options.Language, languages))
    error('kalmems:argument', 'the language ''%s'' is not known; expected ''c'' or ''rust''', char(options.Language));
end
rate = options.Rate;
if isnan(rate)
    rate = 0;
end
found = kalmems_gateway('export', kalmems.internal.text(experiment), [], [], char(options.Filter), double(strcmp(options.Language, 'rust')), rate);
% The names of files are no names of fields: they are read in the order in which both stand in the text.
made = jsondecode(found.json);
names = regexp(found.json, '"([\w.]+\.\w+)":"', 'tokens');
contents = struct2cell(made.files);
files = cell(size(names));
for k = 1:numel(names)
    files{k} = fullfile(char(kalmems.internal.text(folder)), names{k}{1});
    [id, why] = fopen(files{k}, 'w', 'n', 'UTF-8');
    if id < 0
        error('kalmems:argument', '%s: %s', files{k}, why);
    end
    fwrite(id, contents{k}, 'char');
    fclose(id);
end
end
