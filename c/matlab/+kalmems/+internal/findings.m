function found = findings(raw)
% What the gateway has found, with its JSON as structures.
found = struct('metrics', jsondecode(raw.json), 'text', raw.text, 'experiment', raw.experiment);
end
