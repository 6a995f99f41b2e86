function file = report(experiment, file, varargin)
%KALMEMS.REPORT Write the report of an estimate as a page of HTML.
%   KALMEMS.REPORT(EXPERIMENT, FILE, ...) estimates as KALMEMS.ESTIMATE does, with the same further arguments, and writes the page to FILE.
%
%   See also KALMEMS.ESTIMATE.
[recordings, references] = kalmems.internal.given(varargin{:});
html = kalmems_gateway('report', kalmems.internal.text(experiment), recordings, references);
[id, why] = fopen(file, 'w', 'n', 'UTF-8');
if id < 0
    error('kalmems:argument', '%s: %s', file, why);
end
fwrite(id, html, 'char');
fclose(id);
end
