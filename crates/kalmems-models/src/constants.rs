//! Constants of nature, CODATA 2018.

/// k_B in J/K, exact.
pub const BOLTZMANN: f64 = 1.380_649e-23;
/// The charge of an electron in C, exact.
pub const ELEMENTARY_CHARGE: f64 = 1.602_176_634e-19;
/// ε₀ in F/m.
pub const VACUUM_PERMITTIVITY: f64 = 8.854_187_812_8e-12;
/// g_n in m/s², exact: the unit `gn` of accelerations.
pub const STANDARD_GRAVITY: f64 = 9.806_65;
