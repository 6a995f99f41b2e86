function [numbers, names, units] = as_matrix(trajectory)
%KALMEMS.AS_MATRIX The columns of a trajectory as a matrix.
%   [NUMBERS, NAMES, UNITS] = KALMEMS.AS_MATRIX(TRAJECTORY) gives the columns of a trajectory of KALMEMS.ESTIMATE that have a number for each sample, as a
%   matrix with the time first, with their names and units. array2table(NUMBERS, 'VariableNames', NAMES) is a table of MATLAB.
%
%   See also KALMEMS.ESTIMATE, KALMEMS.AS_TIMETABLE.
names = fieldnames(trajectory.units)';
names = names(cellfun(@(name) numel(trajectory.(name)) == numel(trajectory.time), names));
each = cellfun(@(name) trajectory.(name)(:), names, 'UniformOutput', false);
numbers = [each{:}];
units = cellfun(@(name) trajectory.units.(name), names, 'UniformOutput', false);
end
