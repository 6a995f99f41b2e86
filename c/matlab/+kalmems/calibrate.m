function found = calibrate(file)
%KALMEMS.CALIBRATE Calibrate a gyroscope.
%   FOUND = KALMEMS.CALIBRATE(FILE) does what the command kalmems calibrate gyro does with this file. FOUND has the fields metrics, as the command
%   writes them, and text.
found = rmfield(kalmems.internal.findings(kalmems_gateway('calibrate', kalmems.internal.text(file))), 'experiment');
end
