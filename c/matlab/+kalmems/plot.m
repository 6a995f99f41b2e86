function handle = plot(trajectory, state)
%KALMEMS.PLOT Draw a state of a trajectory with its claimed standard deviation.
%   KALMEMS.PLOT(TRAJECTORY) draws the first state of a trajectory of KALMEMS.ESTIMATE, and the band of two claimed standard deviations.
%
%   HANDLE = KALMEMS.PLOT(TRAJECTORY, STATE) draws the state of this name, such as 'rate', and returns the handle of its line.
%
%   See also KALMEMS.ESTIMATE, KALMEMS.AS_TIMETABLE.
names = fieldnames(trajectory.units);
if nargin < 2
    state = names{2};
end
if ~any(strcmp(names, state))
    error('kalmems:argument', 'the trajectory has no ''%s''; it has %s', state, strjoin(names', ', '));
end
t = trajectory.time(:);
x = trajectory.(state)(:);
deviation = [state '_sd'];
if isfield(trajectory, deviation) && numel(trajectory.(deviation)) == numel(x)
    sd = trajectory.(deviation)(:);
    patch([t; flipud(t)], [x + 2 * sd; flipud(x - 2 * sd)], [0.8 0.85 0.95], 'EdgeColor', 'none');
end
handle = line(t, x);
xlabel('time (s)')
ylabel(sprintf('%s (%s)', strrep(state, '_', ' '), trajectory.units.(state)))
title(trajectory.name)
end
