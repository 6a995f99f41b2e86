// In the place of the windows of IMU-TK, which need Qt and OpenGL.
#pragma once
#include "imu_tk/base.h"

namespace imu_tk {
struct Plot {
    template <typename... Arguments> void plotSamples(Arguments...) {}
    template <typename... Arguments> void plotIntervals(Arguments...) {}
};
inline void waitForKey() {}
}
