//! A simulator of its own: random numbers, attitudes and sensors without anything of the crate that is tested.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Standard gravity in m/s².
pub const GRAVITY: f64 = 9.806_65;
/// The rate of the Earth's rotation in rad/s.
const EARTH: f64 = 7.292e-5;

pub type Vector = [f64; 3];
pub type Matrix = [Vector; 3];

/// Normal numbers by xorshift and the method of Box and Muller.
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        let mut noise = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..20 {
            noise.uniform();
        }
        noise
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    fn direction(&mut self) -> Vector {
        unit([self.normal(), self.normal(), self.normal()])
    }
}

pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn unit(a: Vector) -> Vector {
    let size = dot(a, a).sqrt();
    a.map(|part| part / size)
}

pub fn times(matrix: &Matrix, a: Vector) -> Vector {
    matrix.map(|row| dot(row, a))
}

/// A vector of the world in the body's axes after the body has turned by this vector.
fn turned(v: Vector, by: Vector) -> Vector {
    let angle = dot(by, by).sqrt();
    if angle < 1e-300 {
        return v;
    }
    let axis = by.map(|part| part / angle);
    let (sine, cosine) = (-angle).sin_cos();
    let across = cross(axis, v);
    let along = dot(axis, v) * (1.0 - cosine);
    std::array::from_fn(|i| v[i] * cosine + across[i] * sine + axis[i] * along)
}

/// The errors of a unit: shown = K·true + b, with noise of each sample.
#[derive(Clone, Copy)]
pub struct Unit {
    pub accelerometers: Matrix,
    pub accelerometer_bias: Vector,
    pub accelerometer_noise: f64,
    pub gyroscopes: Matrix,
    pub gyroscope_bias: Vector,
    pub gyroscope_noise: f64,
    /// rad/s per m/s².
    pub force_sensitivity: Matrix,
}

pub const UNIT: Unit = Unit {
    accelerometers: [[1.012, 0.004, -0.007], [-0.003, 0.987, 0.005], [0.006, 0.002, 1.021]],
    accelerometer_bias: [0.08, -0.15, 0.11],
    accelerometer_noise: 5e-3,
    gyroscopes: [[0.991, -0.005, 0.008], [0.004, 1.014, 0.003], [-0.006, 0.007, 1.006]],
    gyroscope_bias: [0.004, -0.007, 0.002],
    gyroscope_noise: 2e-3,
    force_sensitivity: [[4e-5, 0.0, -1e-5], [0.0, -3e-5, 0.0], [2e-5, 0.0, 5e-5]],
};

/// A record of positions: rests and turns.
#[derive(Clone, Copy)]
pub struct Turns {
    pub positions: usize,
    pub rate_hz: f64,
    pub rest_s: f64,
    pub turn_s: f64,
    /// By how much the force in a position differs from the model, in m/s²: an axis that is not quite linear.
    pub scatter: f64,
    /// The latitude in rad.
    pub latitude: f64,
    /// Whether all turns are about the third axis, which stays level.
    pub is_flat: bool,
}

pub const TURNS: Turns = Turns {
    positions: 26,
    rate_hz: 100.0,
    rest_s: 2.0,
    turn_s: 1.2,
    scatter: 1e-3,
    latitude: 0.84,
    is_flat: false,
};

/// Steps of the attitude between two samples.
const FINE: usize = 16;

impl Unit {
    /// What the unit shows of a true force and rate.
    fn shown(&self, force: Vector, rate: Vector, noise: &mut Noise) -> [Vector; 2] {
        let (a, g) = (times(&self.accelerometers, force), times(&self.gyroscopes, rate));
        let by_force = times(&self.force_sensitivity, force);
        [
            std::array::from_fn(|i| {
                a[i] + self.accelerometer_bias[i] + self.accelerometer_noise * noise.normal()
            }),
            std::array::from_fn(|i| {
                g[i] + by_force[i] + self.gyroscope_bias[i] + self.gyroscope_noise * noise.normal()
            }),
        ]
    }

    /// Writes a record of positions.
    pub fn write_positions(&self, path: &Path, turns: &Turns, seed: u64) {
        let mut noise = Noise::new(seed);
        let mut text =
            "ax_m_per_s2,ay_m_per_s2,az_m_per_s2,gx_rad_per_s,gy_rad_per_s,gz_rad_per_s\n".to_owned();
        let mut line = |[force, rate]: [Vector; 2]| {
            let [x, y, z] = force;
            let [p, q, r] = rate;
            writeln!(text, "{x:.6},{y:.6},{z:.6},{p:.7},{q:.7},{r:.7}").unwrap();
        };
        let (mut up, mut north) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let step = 1.0 / turns.rate_hz / FINE as f64;
        for _ in 0..turns.positions {
            let earth = |up: Vector, north: Vector| -> Vector {
                let (sine, cosine) = turns.latitude.sin_cos();
                std::array::from_fn(|i| EARTH * (sine * up[i] + cosine * north[i]))
            };
            let off: Vector = std::array::from_fn(|_| turns.scatter * noise.normal());
            for _ in 0..(turns.rest_s * turns.rate_hz) as usize {
                let force = std::array::from_fn(|i| GRAVITY * up[i] + off[i]);
                line(self.shown(force, earth(up, north), &mut noise));
            }
            // Two turns that overlap, so that the axis moves.
            let (first, second) = if turns.is_flat {
                ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
            } else {
                (noise.direction(), noise.direction())
            };
            let sizes = [1.2 + noise.uniform(), 0.6 + noise.uniform()];
            let swell = |t: f64| if (0.0..1.0).contains(&t) { 2.0 * (PI * t).sin().powi(2) } else { 0.0 };
            let rate = |time_s: f64| -> Vector {
                let t = time_s / turns.turn_s;
                let parts = [sizes[0] * swell(t / 0.8) / 0.8, sizes[1] * swell((t - 0.2) / 0.8) / 0.8];
                std::array::from_fn(|i| (first[i] * parts[0] + second[i] * parts[1]) / turns.turn_s)
            };
            // The sensors sit off the centre of the turn.
            let arm = [0.05, -0.03, 0.02];
            let samples = (turns.turn_s * turns.rate_hz).round() as usize;
            for sample in 0..samples {
                let time_s = sample as f64 / turns.rate_hz;
                let now = rate(time_s);
                let later = rate(time_s + 1e-4);
                let turning: Vector = std::array::from_fn(|i| (later[i] - now[i]) / 1e-4);
                let (tangential, inwards) = (cross(turning, arm), cross(now, cross(now, arm)));
                let force = std::array::from_fn(|i| GRAVITY * up[i] + tangential[i] + inwards[i]);
                let of_earth = earth(up, north);
                let all = std::array::from_fn(|i| now[i] + of_earth[i]);
                line(self.shown(force, all, &mut noise));
                for fine in 0..FINE {
                    let middle = rate(time_s + (fine as f64 + 0.5) * step).map(|part| part * step);
                    (up, north) = (turned(up, middle), turned(north, middle));
                }
            }
            (up, north) = (unit(up), unit(north));
        }
        fs::write(path, text).unwrap();
    }
}

/// Row lengths and products of directions of a matrix: scale factors, and xy, xz, yz.
pub fn scales_and_angles(matrix: &Matrix) -> [Vector; 2] {
    let rows = matrix.map(unit);
    [
        matrix.map(|row| dot(row, row).sqrt()),
        [dot(rows[0], rows[1]), dot(rows[0], rows[2]), dot(rows[1], rows[2])],
    ]
}

/// The axes that the first sensor and the plane of the first two make.
pub fn frame(matrix: &Matrix) -> Matrix {
    let x = unit(matrix[0]);
    let along = dot(matrix[1], x);
    let y = unit(std::array::from_fn(|i| matrix[1][i] - along * x[i]));
    [x, y, cross(x, y)]
}
