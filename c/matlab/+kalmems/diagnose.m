function found = diagnose(experiment, varargin)
%KALMEMS.DIAGNOSE Find what of an experiment is wrong.
%   FOUND = KALMEMS.DIAGNOSE(EXPERIMENT, ...) does what the command kalmems diagnose does, with the further arguments of KALMEMS.ESTIMATE and
%      'Filter'    the name of the filter whose innovations are explained; the first one if left out
%      'Thorough'  true to try more causes, which takes longer
%
%   FOUND has the fields
%      metrics     the causes, as the command writes them with --json
%      text        the same as the command prints it
%      experiment  the text of the corrected experiment; empty if no single cause is found
%
%   See also KALMEMS.IDENTIFY.
[recordings, references, options] = kalmems.internal.given(varargin{:});
found = kalmems.internal.findings(kalmems_gateway('diagnose', kalmems.internal.text(experiment), recordings, references, ...
    char(options.Filter), double(options.Thorough)));
end
