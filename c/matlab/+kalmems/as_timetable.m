function made = as_timetable(trajectory)
%KALMEMS.AS_TIMETABLE A trajectory as a timetable.
%   T = KALMEMS.AS_TIMETABLE(TRAJECTORY) is a timetable of a trajectory of KALMEMS.ESTIMATE, with the units of its columns in
%   T.Properties.VariableUnits. For a table write timetable2table(T). It needs MATLAB, as Octave has no tables.
%
%   See also KALMEMS.ESTIMATE, KALMEMS.AS_MATRIX.
if isempty(which('timetable'))
    error('kalmems:argument', 'Octave has no timetables; kalmems.as_matrix gives the columns as a matrix, with their names and units');
end
[numbers, names, units] = kalmems.as_matrix(trajectory);
each = num2cell(numbers(:, 2:end), 1);
made = timetable(seconds(numbers(:, 1)), each{:}, 'VariableNames', names(2:end));
made.Properties.VariableUnits = units(2:end);
end
