function found = identify(experiment, varargin)
%KALMEMS.IDENTIFY Identify the parameters of a device from its recordings.
%   FOUND = KALMEMS.IDENTIFY(EXPERIMENT, ...) does what the command kalmems identify does, with the further arguments of KALMEMS.ESTIMATE.
%
%   FOUND has the fields
%      metrics     what was found, as identification.json has it
%      text        the same as the command prints it
%      experiment  the text of the experiment with the identified values
%
%   See also KALMEMS.ESTIMATE, KALMEMS.DIAGNOSE.
[recordings, references] = kalmems.internal.given(varargin{:});
found = kalmems.internal.findings(kalmems_gateway('identify', kalmems.internal.text(experiment), recordings, references));
end
