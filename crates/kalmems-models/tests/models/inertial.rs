//! Inertial sensors against matrices put together from angles, and points followed in space.

use kalmems_models::inertial::{Alignment, SpecificForce};

/// Rotation by the exponential series of the cross product.
fn turn(vector: [f64; 3]) -> [[f64; 3]; 3] {
    let [x, y, z] = vector;
    let generator = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]];
    let mut sum = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut power = sum;
    for order in 1..30 {
        power = product(&power, &generator).map(|row| row.map(|v| v / f64::from(order)));
        for (row, added) in sum.iter_mut().zip(&power) {
            row.iter_mut().zip(added).for_each(|(a, b)| *a += b);
        }
    }
    sum
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Axes that are not square, put together from their angles, in a case that is turned: each comes back, however large.
#[test]
fn scale_squareness_and_mounting_come_apart() {
    for size in [1e-4, 1e-2, 0.3] {
        let scale = [1.02, 0.97, 1.01];
        let (xy, xz, yz): (f64, f64, f64) = (0.4 * size, -0.7 * size, 0.9 * size);
        // Unit directions with these products, x along x and y in the plane.
        let y1 = (1.0 - xy * xy).sqrt();
        let z1 = (yz - xy * xz) / y1;
        let axes = [[1.0, 0.0, 0.0], [xy, y1, 0.0], [xz, z1, (1.0 - xz * xz - z1 * z1).sqrt()]];
        let vector = [0.5 * size, -0.8 * size, 0.3 * size];
        let turned = product(&axes, &turn(vector));
        let matrix = std::array::from_fn(|i| turned[i].map(|v| scale[i] * v));
        let found = Alignment::of(&matrix);
        let angle = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        for i in 0..3 {
            assert!((found.scale[i] - scale[i]).abs() < 1e-14);
            assert!((found.non_orthogonality[i] - [xy, xz, yz][i]).abs() < 1e-14, "{found:?}");
            assert!(
                (found.mounting[i] - vector[i] / angle * angle.sin()).abs() < 1e-14,
                "{found:?} {vector:?}"
            );
        }
    }
}

/// A point of a body that rocks about a fixed axis, followed in space: its second derivative by differences, seen from the
/// body.
#[test]
fn the_force_is_the_second_derivative_of_the_place() {
    let arm = [0.8e-3, -0.3e-3, 1.1e-3];
    let axis = [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0];
    let (amplitude, rate) = (0.4, 30.0);
    let angle = |t: f64| amplitude * (rate * t).sin();
    // From the body into space.
    let place = |t: f64, v: [f64; 3]| -> [f64; 3] {
        let matrix = turn(axis.map(|a| -a * angle(t)));
        matrix.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
    };
    let gravity = [0.1, -9.7, 1.2];
    for step in 0..20 {
        let t = 0.013 * f64::from(step);
        let h = 1e-4;
        // Fourth order.
        let at = |k: f64| place(t + k * h, arm);
        let second: [f64; 3] = std::array::from_fn(|i| {
            (-at(2.0)[i] + 16.0 * at(1.0)[i] - 30.0 * at(0.0)[i] + 16.0 * at(-1.0)[i] - at(-2.0)[i])
                / (12.0 * h * h)
        });
        let into_body = |v: [f64; 3]| -> [f64; 3] {
            turn(axis.map(|a| a * angle(t))).map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
        };
        let felt = into_body(std::array::from_fn(|i| second[i] - gravity[i]));
        let speed = amplitude * rate * (rate * t).cos();
        let acceleration = -amplitude * rate * rate * (rate * t).sin();
        let found = SpecificForce { arm }.at(
            axis.map(|a| a * speed),
            axis.map(|a| a * acceleration),
            into_body(gravity),
        );
        for i in 0..3 {
            assert!((found[i] - felt[i]).abs() < 1e-6, "{t}: {found:?} {felt:?}");
        }
    }
}
