function all = items(raw)
% Items of a stream as one structure array: estimates with their numbers as fields, events with their data.
all = struct('of', {}, 'time', {}, 'numbers', {}, 'data', {});
for k = 1:numel(raw)
    one = struct('of', raw{k}.of, 'time', raw{k}.time, 'numbers', struct(), 'data', []);
    for i = 1:numel(raw{k}.names)
        one.numbers.(raw{k}.names{i}) = raw{k}.numbers(i);
    end
    if ~isempty(raw{k}.json)
        one.data = jsondecode(raw{k}.json);
    end
    all(k) = one;
end
end
