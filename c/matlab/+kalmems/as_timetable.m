function made = as_timetable(trajectory)
%KALMEMS.AS_TIMETABLE A trajectory as a timetable.
%   T = KALMEMS.AS_TIMETABLE(TRAJECTORY) is a timetable of a trajectory of KALMEMS.ESTIMATE, with the units of its columns in
%   T.Properties.VariableUnits. For a table write timetable2table(T). It needs MATLAB, as Octave has no tables.
%
%   See also KALMEMS.ESTIMATE.
if exist('OCTAVE_VERSION', 'builtin')
    error('kalmems:argument', 'Octave has no timetables; the columns are fields of the trajectory');
end
names = setdiff(fieldnames(trajectory.units), {'time'}, 'stable');
names = names(cellfun(@(name) numel(trajectory.(name)) == numel(trajectory.time), names));
columns = cellfun(@(name) trajectory.(name), names, 'UniformOutput', false);
made = timetable(seconds(trajectory.time), columns{:}, 'VariableNames', names);
made.Properties.VariableUnits = cellfun(@(name) trajectory.units.(name), names, 'UniformOutput', false)';
end
