% What a program in MATLAB or Octave sees: octave --eval "check_octave('experiment.toml', 'recording.csv', 'folder')"
function check_octave(experiment, recording_file, folder)
assert(ischar(kalmems.version()) && numel(kalmems.version()) > 4)

% Files, and the same numbers as arrays.
of_files = kalmems.estimate(experiment);
lines = strsplit(fileread(recording_file), "\n");
lines = lines(~strncmp(lines, '#', 1));
names = strsplit(strtrim(lines{1}), ',');
numbers = sscanf(strjoin(lines(2:end), ','), '%g,', [numel(names), Inf])';
recording = struct();
for k = 1:numel(names)
    recording.(names{k}) = numbers(:, k);
end
of_arrays = kalmems.estimate(experiment, recording);
assert(numel(of_files.trajectories) == numel(of_arrays.trajectories) && numel(of_files.trajectories) > 1)
for k = 1:numel(of_files.trajectories)
    a = of_files.trajectories(k);
    b = of_arrays.trajectories(k);
    assert(strcmp(a.name, b.name) && a.passes == b.passes)
    assert(isequaln_of(a.time, b.time) && isequaln_of(a.angle, b.angle) && isequaln_of(a.angle_sd, b.angle_sd))
    assert(strcmp(a.units.angle, 'rad') && strcmp(a.units.time, 's'))
end
assert(~isempty(of_arrays.notices) && ~isempty(strfind(of_arrays.summary, 'EKF')))
assert(isstruct(of_arrays.metrics) && isfield(of_arrays.metrics, 'schema_version'))

% The numbers that the command writes.
written = kalmems.estimate(experiment, recording, 'Folder', folder, 'Force', true);
assert(exist(fullfile(folder, 'metrics.json'), 'file') == 2)
assert(isequaln_of(written.trajectories(2).angle, of_files.trajectories(2).angle))
page = kalmems.report(experiment, fullfile(folder, 'page.html'), recording);
assert(~isempty(strfind(fileread(page), '<html')))

% Errors have identifiers, and say what to do.
expect('kalmems:experiment', 'no/such/file.toml', @() kalmems.estimate('no/such/file.toml'))
expect('kalmems:argument', 'known options', @() kalmems.estimate(experiment, recording, 'Ratte', 1))
expect('kalmems:argument', 'cap_V', @() kalmems.estimate(experiment, struct('cap_V', {{1, 2}})))
expect('kalmems:argument', 'leave it out', @() kalmems.estimate(experiment, []))
expect('kalmems:argument', 'structure array', @() kalmems.estimate(experiment, [recording, recording]))
short = recording;
short.(names{1}) = short.(names{1})(1:10);
expect('kalmems:argument', names{1}, @() kalmems.estimate(experiment, short))
disp('the package does for Octave what the command does')
end

function same = isequaln_of(a, b)
same = isequal(size(a), size(b)) && all(a == b | (isnan(a) & isnan(b)));
end

function expect(identifier, part, call)
try
    call();
catch e
    assert(strcmp(e.identifier, identifier), 'identifier %s instead of %s: %s', e.identifier, identifier, e.message)
    assert(~isempty(strfind(e.message, part)), 'not in the message: %s: %s', part, e.message)
    return
end
error('no error with the identifier %s', identifier)
end
