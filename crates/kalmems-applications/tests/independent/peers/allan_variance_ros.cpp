// A record of one gyroscope (f64, rad/s) through the class of allan_variance_ros (ori-drs/allan_variance_ros) as it is, without a bag. Its sources are
// included, as its header defines functions that two files would both have:
//     g++ -O3 -std=c++17 -fopenmp -fno-access-control -I without_master -I ALLAN/include -I ALLAN -I/usr/include/{eigen3,pluginlib,class_loader,rcutils,rcpputils} \
//         -I /usr/include/ament_index_cpp allan_variance_ros.cpp \
//         -lrosbag -lrosbag_storage -lrosconsole -lrostime -lroscpp_serialization -lcpp_common -lyaml-cpp
#include <fstream>
#include <iomanip>
#include <map>
#include "src/AllanVarianceComputor.cpp"
#include "src/ImuMeasurement.cpp"
#include "src/yaml_parsers.cpp"
#include <cstdio>

int main(int, char **arguments) {
    ros::NodeHandle node;
    allan_variance_ros::AllanVarianceComputor record(node, arguments[1], arguments[2]);
    record.av_output_ = std::ofstream(record.imu_output_file_);
    FILE *file = fopen(arguments[3], "rb");
    double value;
    while (fread(&value, 8, 1, file) == 1) {
        ImuMeasurement measurement;
        measurement.I_a_WI = measurement.I_w_WI = Eigen::Vector3d(value, value, value);
        record.imuBuffer_.push_back(measurement);
    }
    record.allanVariance();
}
