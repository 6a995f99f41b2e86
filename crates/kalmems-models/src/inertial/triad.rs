//! Three sensitive axes that are neither equal nor square.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// Ω_I = K·Ω + b: three gyroscopes, or three accelerometers, in one case (Chen, dissertation, 2018, equation 19).
///
/// Row i of K is the direction that sensor i feels, times its scale factor; what stands beside the diagonal is called
/// cross-axis sensitivity.
///
/// ```
/// use kalmems_models::inertial::Triad;
/// let gyroscope = Triad {
///     x: [1.01, 0.004, 0.0],
///     y: [-0.002, 0.99, 0.0],
///     z: [0.0, 0.0, 1.0],
///     bias: [0.03, 0.0, -0.01],
/// };
/// assert_eq!(gyroscope.output([10.0_f64, 0.0, 0.0]), [1.01 * 10.0 + 0.03, -0.02, -0.01]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct Triad<P> {
    /// The first row of K, without dimension.
    pub x: [P; 3],
    /// The second row.
    pub y: [P; 3],
    /// The third row.
    pub z: [P; 3],
    /// b in the unit of what is felt.
    pub bias: [P; 3],
}

#[model]
impl<P: Scalar> Triad<P> {
    /// K·Ω + b.
    pub fn output<S: Over<P>>(&self, input: [S; 3]) -> [S; 3] {
        [
            felt(input, self.x) + self.bias[0],
            felt(input, self.y) + self.bias[1],
            felt(input, self.z) + self.bias[2],
        ]
    }
}

/// K = S·N·R: scale factors, non-orthogonality and mounting, told apart.
///
/// S is diagonal, N has unit rows and is lower triangular, R turns the frame of the reference into that of the unit,
/// whose x axis is by convention the first sensor's, and whose xy plane holds the first two. So the three angles of N are
/// properties of the unit alone, the three of R belong to how it was mounted, and all nine entries of K are needed: N·R
/// is a matrix of six numbers, the three lengths of its rows being one. (Gram and Schmidt on the rows of K.)
///
/// ```
/// use kalmems_models::inertial::Alignment;
/// // Square, but turned by 0.01 about z.
/// let (c, s) = (0.01_f64.cos(), 0.01_f64.sin());
/// let alignment = Alignment::of(&[[1.02 * c, 1.02 * s, 0.0], [-s, c, 0.0], [0.0, 0.0, 0.97]]);
/// assert!((alignment.scale[0] - 1.02).abs() < 1e-15 && (alignment.scale[2] - 0.97).abs() < 1e-15);
/// assert!((alignment.mounting[2] - s).abs() < 1e-15);
/// assert!(alignment.non_orthogonality.iter().all(|angle| angle.abs() < 1e-15));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment<P> {
    /// The lengths of the rows: the scale factors along the sensitive axes.
    pub scale: [P; 3],
    /// Sines of the angles by which xy, xz and yz are closer than square: the products of the axes' directions.
    pub non_orthogonality: [P; 3],
    /// The turn from the reference's frame into the unit's: (R₂₃ − R₃₂)/2, (R₃₁ − R₁₃)/2, (R₁₂ − R₂₁)/2, which are the
    /// sine of its angle times its axis; for a small turn, its angles about x, y and z in rad.
    pub mounting: [P; 3],
}

#[model]
impl<P: Scalar> Alignment<P> {
    /// Takes a matrix apart; not numbers where two of its rows are parallel.
    pub fn of(matrix: &[[P; 3]; 3]) -> Self {
        let scale = [norm(matrix[0]), norm(matrix[1]), norm(matrix[2])];
        let axis = [
            along(matrix[0], scale[0].recip()),
            along(matrix[1], scale[1].recip()),
            along(matrix[2], scale[2].recip()),
        ];
        let [xy, xz, yz] = [dot(axis[0], axis[1]), dot(axis[0], axis[2]), dot(axis[1], axis[2])];
        let x = axis[0];
        let rest = [axis[1][0] - x[0] * xy, axis[1][1] - x[1] * xy, axis[1][2] - x[2] * xy];
        let y = along(rest, norm(rest).recip());
        let z = super::cross(x, y);
        Self {
            scale,
            non_orthogonality: [xy, xz, yz],
            mounting: [(y[2] - z[1]).half(), (z[0] - x[2]).half(), (x[1] - y[0]).half()],
        }
    }
}

#[inline(always)]
fn felt<P: Scalar, S: Over<P>>(input: [S; 3], row: [P; 3]) -> S {
    input[0] * row[0] + input[1] * row[1] + input[2] * row[2]
}

#[inline(always)]
fn dot<P: Scalar>(a: [P; 3], b: [P; 3]) -> P {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn norm<P: Scalar>(a: [P; 3]) -> P {
    dot(a, a).sqrt()
}

#[inline(always)]
fn along<P: Scalar>(a: [P; 3], factor: P) -> [P; 3] {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}
