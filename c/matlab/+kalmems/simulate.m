function found = simulate(experiment)
%KALMEMS.SIMULATE Simulate the recording that an experiment describes.
%   FOUND = KALMEMS.SIMULATE(EXPERIMENT) has the fields
%      recording   the columns that would be recorded, a structure that KALMEMS.ESTIMATE takes
%      truth       the columns of the true motion
%      experiment  the text of the experiment of the recording
%
%   See also KALMEMS.ESTIMATE.
found = rmfield(kalmems_gateway('simulate', kalmems.internal.text(experiment), [], []), {'json', 'text'});
end
