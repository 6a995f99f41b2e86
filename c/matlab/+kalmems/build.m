function build()
%KALMEMS.BUILD Build the library and the gateway that this package calls.
%   KALMEMS.BUILD() runs cargo, the build command of Rust, and mex, or in Octave mkoctfile. It takes some minutes, once.
%
%   See also KALMEMS.ESTIMATE.
here = fileparts(fileparts(mfilename('fullpath')));
root = fileparts(here);
assert(system(['cargo build --release --locked --manifest-path "' fullfile(root, 'Cargo.toml') '"']) == 0, ...
    'kalmems:build', 'the library could not be built; Rust must be installed');
library = fullfile(root, 'target', 'release');
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
