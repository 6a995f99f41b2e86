function file = write_mat(result, file)
%KALMEMS.WRITE_MAT Write a result into a MAT file.
%   KALMEMS.WRITE_MAT(RESULT, FILE) writes what KALMEMS.ESTIMATE or KALMEMS.SIMULATE returned; load(FILE) gives its fields as variables.
%
%   See also KALMEMS.ESTIMATE.
save('-v7', file, '-struct', 'result');
end
