function all = joined(structures)
% A structure array of structures that do not all have the same fields; what one lacks is empty.
names = {};
for k = 1:numel(structures)
    names = [names; setdiff(fieldnames(structures{k}), names, 'stable')]; %#ok<AGROW>
end
all = [];
for k = 1:numel(structures)
    one = structures{k};
    for i = 1:numel(names)
        if ~isfield(one, names{i})
            one.(names{i}) = [];
        end
    end
    all = [all, orderfields(one, names)]; %#ok<AGROW>
end
end
