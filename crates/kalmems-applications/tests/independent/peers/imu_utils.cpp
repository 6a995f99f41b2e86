// A record of one gyroscope (f64, rad/s) through the classes of imu_utils (gaowenliang/imu_utils) as they are:
//     g++ -O3 -std=c++17 -fopenmp -I IMU_UTILS -I /usr/include/eigen3 imu_utils.cpp IMU_UTILS/src/gyr_lib/*.cpp -lceres -lglog
#include "src/gyr_lib/allan_gyr.h"
#include "src/gyr_lib/fitallan_gyr.h"
#include <cstdio>

int main(int, char **arguments) {
    imu::AllanGyr record("gyroscope", 100);
    FILE *file = fopen(arguments[1], "rb");
    double value, rate = atof(arguments[2]);
    for (long k = 0; fread(&value, 8, 1, file) == 1; k++) record.pushRadPerSec(value, k / rate);
    record.calc();
    imu::FitAllanGyr fit(record.getVariance(), record.getTimes(), record.getFreq());
    // Its two numbers of a file for Kalibr are for one sample (the white noise) and the lowest deviation.
    printf("found %.9g %.9g\n", fit.getWhiteNoise() / sqrt(rate), fit.getBiasInstability());
}
