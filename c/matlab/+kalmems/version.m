function text = version()
%KALMEMS.VERSION The version of kalmems.
%   TEXT = KALMEMS.VERSION() is the version of the library behind this package, such as '0.1.0'.
text = kalmems_gateway('version');
end
