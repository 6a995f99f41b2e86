function [recordings, references, options] = given(varargin)
% The recordings and references that arguments hand over, as the gateway takes them, and the other options.
options = struct('Units', struct(), 'Rate', NaN, 'Clock', '', 'Segments', '', 'Reference', [], 'Recording', '', ...
    'Folder', '', 'Force', false, 'Filter', '', 'Thorough', false, 'Language', 'c');
recordings = [];
references = [];
recording = [];
is_given = false;
if ~isempty(varargin) && ~ischar(kalmems.internal.text(varargin{1}))
    recording = varargin{1};
    is_given = true;
    varargin(1) = [];
end
if mod(numel(varargin), 2) ~= 0
    error('kalmems:argument', 'options come as names and values');
end
for k = 1:2:numel(varargin)
    name = char(varargin{k});
    if ~isfield(options, name)
        error('kalmems:argument', 'unknown option ''%s''; known options: %s', name, strjoin(fieldnames(options)', ', '));
    end
    options.(name) = varargin{k + 1};
end
if is_given
    recordings = handed_over(recording, options);
end
if ~isequal(options.Reference, [])
    references = handed_over(options.Reference, setfield(setfield(options, 'Rate', NaN), 'Clock', ''));
end
end

function recording = handed_over(columns, options)
if ~isstruct(columns) && ~isobject(columns)
    error('kalmems:argument', 'a recording is a structure or a table of vectors, and an empty one is none; leave it out to read the file of the experiment');
end
if isstruct(columns) && numel(columns) ~= 1
    error('kalmems:argument', 'a structure array with %d elements; expected one structure of vectors, one estimate for each recording', numel(columns));
end
if ~isstruct(columns)
    columns = table2struct(columns, 'ToScalar', true);
end
names = fieldnames(columns)';
numbers = cell(size(names));
for k = 1:numel(names)
    value = columns.(names{k});
    if ~(isnumeric(value) || islogical(value)) || ~(isvector(value) || isempty(value))
        error('kalmems:argument', '%s: a vector of numbers is expected', names{k});
    end
    numbers{k} = double(full(value(:)));
end
units = {};
columns_with_units = fieldnames(options.Units)';
for k = 1:numel(columns_with_units)
    units(end + (1:2)) = {columns_with_units{k}, char(options.Units.(columns_with_units{k}))}; %#ok<AGROW>
end
recording = struct('of', char(options.Recording), 'names', {names}, 'columns', {numbers}, 'units', {units}, ...
    'segments', char(options.Segments), 'clock', char(options.Clock), 'rate', double(options.Rate));
end
