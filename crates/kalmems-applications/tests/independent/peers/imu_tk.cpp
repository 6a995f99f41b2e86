// The record of `xsens.py` through the classes of IMU-TK (Kyle-ak/imu_tk), with the settings of its own `apps/test_imu_calib.cpp`. Four of its setters return
// nothing where they say that they do, which ends the program unless it is built without optimisation:
//     g++ -O0 -std=c++17 -fopenmp -I without_window -I IMU_TK/include -I /usr/include/eigen3 imu_tk.cpp IMU_TK/src/{calibration,filters,io_utils}.cpp -lceres -lglog
#include "imu_tk/calibration.h"
#include "imu_tk/io_utils.h"

int main(int, char **arguments) {
    std::vector<imu_tk::TriadData> accelerometers, gyroscopes;
    imu_tk::importAsciiData(arguments[1], accelerometers, imu_tk::TIMESTAMP_UNIT_SEC);
    imu_tk::importAsciiData(arguments[2], gyroscopes, imu_tk::TIMESTAMP_UNIT_SEC);
    imu_tk::CalibratedTriad accelerometer, gyroscope;
    accelerometer.setBias(Eigen::Vector3d::Constant(32768));
    gyroscope.setScale(Eigen::Vector3d::Constant(1.0 / 6258));
    imu_tk::MultiPosCalibration calibration;
    calibration.setInitStaticIntervalDuration(50);
    calibration.setInitAccCalibration(accelerometer);
    calibration.setInitGyroCalibration(gyroscope);
    calibration.setGravityMagnitude(9.81744);
    calibration.enableVerboseOutput(false);
    calibration.enableAccUseMeans(false);
    calibration.calibrateAccGyro(accelerometers, gyroscopes);
    calibration.getAccCalib().save("accelerometer.txt");
    calibration.getGyroCalib().save("gyroscope.txt");
}
