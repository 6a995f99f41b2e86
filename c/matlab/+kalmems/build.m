function build()
%KALMEMS.BUILD Build the library and the gateway that this package calls.
%   KALMEMS.BUILD() runs cargo, the build command of Rust, and mex, or in Octave mkoctfile. It takes some minutes, once. The library is built
%   into the folder that the environment variable CARGO_TARGET_DIR names, otherwise into c/target.
%
%   See also KALMEMS.ESTIMATE.
here = fileparts(fileparts(mfilename('fullpath')));
root = fileparts(here);
target = getenv('CARGO_TARGET_DIR');
if isempty(target)
    target = 'target';
end
% Cargo reads the compiler's flags from c/.cargo/config.toml in that folder only, and takes a relative target from there.
before = cd(root);
restore = onCleanup(@() cd(before));
assert(system('cargo build --release --locked') == 0, 'kalmems:build', 'the library could not be built; Rust must be installed');
[~, place] = fileattrib(fullfile(target, 'release'));
library = place.Name;
clear restore
source = fullfile(here, 'kalmems_gateway.c');
include = ['-I' fullfile(root, 'include')];
options = {include, source, ['-L' library], '-lkalmems_c'};
if exist('OCTAVE_VERSION', 'builtin')
    mex('-DOCTAVE_MEX', options{:}, ['-Wl,-rpath,' library], '-o', fullfile(here, 'kalmems_gateway'))
elseif isunix
    mex(options{:}, '-lut', ['LDFLAGS=$LDFLAGS -Wl,-rpath,' library], '-outdir', here)
else
    mex(options{:}, '-lut', '-outdir', here)
    copyfile(fullfile(library, 'kalmems_c.dll'), here);
end
end
