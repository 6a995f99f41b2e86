function value = text(value)
% A string scalar of MATLAB as characters, which the gateway takes; any other value as it is.
if isstring(value)
    value = char(value);
end
end
