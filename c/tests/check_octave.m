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
    assert(strcmp(a.name, b.name) && a.passes == b.passes && strcmp(a.grade, b.grade))
    assert(isequaln_of(a.time, b.time) && isequaln_of(a.angle, b.angle) && isequaln_of(a.angle_sd, b.angle_sd))
    assert(strcmp(a.units.angle, 'rad') && strcmp(a.units.time, 's'))
end
assert(strcmp(of_files.trajectories(1).grade, 'no_claim') && strcmp(of_files.trajectories(2).grade, 'doubtful'))
assert(~isempty(of_arrays.notices) && ~isempty(strfind(of_arrays.summary, 'EKF')))
assert(isstruct(of_arrays.metrics) && isfield(of_arrays.metrics, 'schema_version'))

% The numbers that the command writes, of the one estimate that is returned; texts may be string scalars.
written = kalmems.estimate(StringScalar(experiment), recording, 'Folder', StringScalar(folder), 'Force', true);
expect('kalmems:argument', 'for the functions of', @() kalmems_gateway('write', experiment, [], [], folder, 1))
assert(exist(fullfile(folder, 'metrics.json'), 'file') == 2)
assert(isequaln_of(written.trajectories(2).angle, of_files.trajectories(2).angle))
page = kalmems.report(StringScalar(experiment), fullfile(folder, 'page.html'), recording);
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
check_work(fileparts(experiment), folder)
check_answers(fileparts(experiment), recording, folder)
check_build()
disp('the package does for Octave what the command does')
end

% Streams, and work other than estimates.
function check_work(scanner, folder)
simulated = kalmems.simulate(fullfile(scanner, 'simulation.toml'));
assert(numel(simulated.recording.time_s) == 60001 && simulated.truth.angle_rad(1) == 1e-4)
files = kalmems.export(fullfile(scanner, 'experiment.toml'), folder, 'Rate', 1e6);
assert(numel(files) > 1 && all(cellfun(@(file) exist(file, 'file') == 2, files)))
header = files{find(cellfun(@(file) strcmp(file(end - 1:end), '.h'), files), 1)};
assert(~isempty(strfind(fileread(header), '#ifndef')))
expect('kalmems:argument', 'expected ''c''', @() kalmems.export(fullfile(scanner, 'experiment.toml'), folder, 'Language', 'ada'))
expect('kalmems:experiment', 'identify', @() kalmems.identify(fullfile(scanner, 'simulation.toml')))

text = fileread(fullfile(scanner, 'recording.csv'));
of_bytes = kalmems.Stream(fullfile(scanner, 'stream.toml'));
of_bytes.push(uint8(text(1:floor(end / 2))))
first = of_bytes.poll(10);
of_bytes.push(uint8(text(floor(end / 2) + 1:end)))
items = [first, of_bytes.finish()];
estimates = items(strcmp({items.of}, 'ekf'));
assert(numel(estimates) == 2401 && isfield(estimates(end).numbers, 'angle_rad') && abs(estimates(end).time - 0.024) < 1e-9)
assert(any(strcmp({items.of}, 'event')) && of_bytes.summary.estimated == 24001)
lines = strsplit(strtrim(text), "\n");
numbers = sscanf(strjoin(lines(2:end), ','), '%g,', [3, Inf])';
of_rows = kalmems.Stream(fullfile(scanner, 'stream.toml'));
expect('kalmems:argument', '2 columns; the stream consists of 3', @() of_rows.push(numbers(1:10, 1:2)))
of_rows.push(numbers)
again = of_rows.finish();
again = again(strcmp({again.of}, 'ekf'));
assert(numel(again) == numel(estimates) && again(end).numbers.angle_rad == estimates(end).numbers.angle_rad)
delete(of_rows)
expect('kalmems:argument', 'was closed', @() of_rows.poll())
stopped = kalmems.Stream(fullfile(scanner, 'stream.toml'));
stopped.push(numbers)
delete(stopped)

estimated = kalmems.estimate(fullfile(scanner, 'experiment.toml'));
trajectory = estimated.trajectories(2);
set(0, 'DefaultFigureVisible', 'off')
line_of_plot = kalmems.plot(trajectory, 'rate');
assert(numel(get(line_of_plot, 'YData')) == numel(trajectory.rate))
close('all')
expect('kalmems:argument', 'it has time, angle', @() kalmems.plot(trajectory, 'angel'))
file = kalmems.write_mat(simulated, fullfile(folder, 'simulated.mat'));
loaded = load(file);
assert(isequal(loaded.truth.angle_rad, simulated.truth.angle_rad))
check_tables(trajectory)
end

% A trajectory as a matrix and as a timetable, which programs stand for that keep what they are given.
function check_tables(trajectory)
[numbers, names, units] = kalmems.as_matrix(trajectory);
assert(isequal(names(1:3), {'time', 'angle', 'angle_sd'}) && isequal(units(1:3), {'s', 'rad', 'rad'}))
assert(isequal(size(numbers), [numel(trajectory.time), numel(names)]) && isequal(numbers(:, 2), trajectory.angle(:)))
expect('kalmems:argument', 'kalmems.as_matrix', @() kalmems.as_timetable(trajectory))
work = tempname();
mkdir(work);
restore = onCleanup(@() restored({}, {}, work));
program(fullfile(work, 'seconds.m'), 'function made = seconds(numbers)\nmade = struct(''seconds'', numbers);\nend\n')
program(fullfile(work, 'timetable.m'), ['function made = timetable(times, varargin)\nmade = struct(''times'', times, ''columns'', ' ...
    '{varargin(1:end - 2)}, ''names'', {varargin{end}}, ''Properties'', struct(''VariableUnits'', {{}}));\nend\n'])
addpath(work)
made = kalmems.as_timetable(trajectory);
assert(isequal(made.times.seconds, trajectory.time(:)) && isequal(made.names, names(2:end)) && isequal(made.Properties.VariableUnits, units(2:end)))
assert(isequaln_of([made.columns{:}], numbers(:, 2:end)))
end

% What is found of simulated recordings is how they were made: Table II of Chen et al. 2020, and the numbers in the README of the gyroscope.
function check_answers(scanner, recording, folder)
file = fullfile(scanner, 'ring_down.toml');
identified = kalmems.identify(file);
given = kalmems.identify(file, recording, 'Recording', 'steady-state');
truth = {'stiffness k', 1.10e-4; 'damping b', 5.95e-12; 'nominal capacitance C0', 5.71e-12; 'angular width theta0', 0.2; ...
    'circuit gain a', -3.574e11; 'circuit offset b', 6.3945};
for k = 1:size(truth, 1)
    found = of_name(identified.metrics.parameters, truth{k, 1});
    assert(abs(found.value - truth{k, 2}) < 4 * found.standard_error && found.standard_error < 0.01 * abs(found.value), truth{k, 1})
    of_arrays = of_name(given.metrics.parameters, truth{k, 1});
    assert(found.value == of_arrays.value)
end
assert(~isempty(strfind(identified.text, 'stiffness k')))
% A signal of twice the size is that of a circuit with twice the gain.
doubled = recording;
doubled.cap_V = 2 * doubled.cap_V;
other = kalmems.identify(file, doubled, 'Recording', 'steady-state');
found = of_name(other.metrics.parameters, 'circuit gain a');
of_file = of_name(identified.metrics.parameters, 'circuit gain a');
assert(abs(found.value / (2 * of_file.value) - 1) < 1e-6)

file = fullfile(scanner, 'experiment.toml');
diagnosed = kalmems.diagnose(file, 'Filter', 'EKF');
given = kalmems.diagnose(file, recording, 'Filter', 'EKF');
assert(isequal(diagnosed.metrics.causes, given.metrics.causes) && strcmp(diagnosed.text, given.text))
cause = diagnosed.metrics.causes(1);
assert(strcmp(cause.name, 'resonator.stiffness') && cause.passes)
assert(abs(sscanf(cause.edits(1).to, '"%g N m"') / 1.10e-4 - 1) < 4 * cause.edits(1).sd)
expect('kalmems:experiment', 'there is no filter `LKF`', @() kalmems.diagnose(file, 'Filter', 'LKF'))
% The experiment with the value that was found, in place of the wrong one.
corrected = fullfile(folder, 'corrected.toml');
copyfile(fullfile(scanner, '*.csv'), folder)
id = fopen(corrected, 'w');
fwrite(id, diagnosed.experiment);
fclose(id);
before = kalmems.estimate(file);
after = kalmems.estimate(corrected);
assert(strcmp(before.trajectories(2).grade, 'doubtful') && strcmp(after.trajectories(2).name, 'EKF') && after.trajectories(2).passes)

calibrated = kalmems.calibrate(fullfile(scanner, '..', 'gyroscope', 'calibration.toml'));
scale = calibrated.metrics.results(1).scale_factor;
assert(abs(scale.value - 1.0137) < 2 * scale.uncertainty && scale.uncertainty < 2e-4)
assert(~isempty(strfind(calibrated.text, '1.01370')))
expect('kalmems:experiment', 'gyroscope', @() kalmems.calibrate(fullfile(scanner, 'image.toml')))
end

% The element with this name, of a structure array or a cell array of structures.
function found = of_name(all, name)
if iscell(all)
    all = all(cellfun(@(one) strcmp(one.name, name), all));
    found = all{1};
else
    found = all(strcmp({all.name}, name));
end
end

% The folders and options with which kalmems.build runs cargo and mex, recorded by programs that replace them.
function check_build()
work = tempname();
mkdir(work);
target = fullfile(work, 'of its own');
root = fileparts(fileparts(which('kalmems_gateway')));
variables = {'PATH', 'CARGO_TARGET_DIR'};
before = cellfun(@getenv, variables, 'UniformOutput', false);
restore = onCleanup(@() restored(variables, before, work));
program(fullfile(work, 'cargo'), ['#!/bin/sh\npwd -P >"' work '/cargo_folder"\nmkdir -p "${CARGO_TARGET_DIR:-target}/release"\n'])
system(['chmod +x "' fullfile(work, 'cargo') '"']);
program(fullfile(work, 'mex.m'), ['function mex(varargin)\nfile = fopen(''' work '/mex_arguments'', ''w'');\n' ...
    'fprintf(file, ''%%s\\n'', pwd, varargin{:});\nfclose(file);\nend\n'])
warning('off', 'Octave:shadowed-function', 'local');
addpath(work)
setenv('PATH', [work ':' before{1}])
setenv('CARGO_TARGET_DIR', target)
kalmems.build()
given = strsplit(fileread(fullfile(work, 'mex_arguments')), "\n");
assert(strcmp(strtrim(fileread(fullfile(work, 'cargo_folder'))), root))
assert(strcmp(given{1}, pwd) && any(strcmp(given, ['-L' fullfile(target, 'release')])))
end

function restored(variables, values, work)
rmpath(work)
cellfun(@setenv, variables, values);
confirm_recursive_rmdir(false, 'local');
rmdir(work, 's');
end

function program(file, format)
id = fopen(file, 'w');
fprintf(id, format);
fclose(id);
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
