//! Where a parameter may lie, by the likelihood itself.

/// 95 % of a Gaussian lie within so many standard deviations.
pub const TWO_SIDED: f64 = 1.959_963_984_540_054;

/// How near the likelihood has to come to what it falls to at the end of an interval, in standard deviations.
const NEAR: f64 = 0.02;

/// Attempts to come as near.
const ATTEMPTS: usize = 8;

/// How far a parameter may go to one side of its likeliest value before ln p, with all others as likely as they can be, has fallen by
/// ½·1.96²: the end of its interval of 95 % by the profile of the likelihood (Venzon & Moolgavkar, Applied Statistics 37, 87, 1988).
/// Infinite where nothing within `room` sets an end.
///
/// Far from the maximum the likelihood of what is hardly known is no Gaussian: it has a limit on one side and none on the other, or bends.
/// Fisher's information knows its curvature at the top alone, and `deviation` by it is where the search begins. `fallen` gives √(2·fall)
/// of ln p at a distance, which is in proportion to the distance where the likelihood is Gaussian.
///
/// # Errors
/// Those of `fallen`.
pub fn likelihood_half_width<E>(
    deviation: f64,
    room: f64,
    fallen: &mut dyn FnMut(f64) -> Result<f64, E>,
) -> Result<f64, E> {
    // The next attempt follows from the last one.
    let (mut inside, mut outside) = ((0.0, 0.0), None::<(f64, f64)>);
    let mut distance = TWO_SIDED * deviation;
    for _ in 0..ATTEMPTS {
        distance = distance.min(room);
        let fall = fallen(distance)?;
        if (fall - TWO_SIDED).abs() < NEAR {
            return Ok(distance);
        }
        if fall > TWO_SIDED {
            outside = Some((distance, fall));
        } else {
            inside = (distance, fall);
            if distance >= room {
                return Ok(f64::INFINITY);
            }
        }
        distance = match outside {
            Some(outside) => {
                let share = (TWO_SIDED - inside.1) / (outside.1 - inside.1);
                // Never so near to an end that is known that nothing would be learnt.
                inside.0 + share.clamp(0.05, 0.95) * (outside.0 - inside.0)
            }
            None => inside.0 * (1.1 * TWO_SIDED / inside.1.max(0.5 * TWO_SIDED)),
        };
    }
    Ok(outside.map_or(f64::INFINITY, |(distance, _)| distance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn of(deviation: f64, room: f64, fallen: fn(f64) -> f64) -> f64 {
        let Ok(found) =
            likelihood_half_width::<Infallible>(deviation, room, &mut |distance| Ok(fallen(distance)));
        found
    }

    #[test]
    fn a_gaussian_likelihood_ends_at_two_standard_deviations_and_a_bent_one_where_it_has_fallen() {
        assert!((of(0.5, 100.0, |d| d / 0.5) - 0.5 * TWO_SIDED).abs() < 1e-12);
        // The curvature at the top is wrong by a factor of four, and the fall goes with the square of the distance.
        let bent = of(2.0, 100.0, |d| d * d);
        assert!((bent * bent - TWO_SIDED).abs() < NEAR, "{bent}");
        assert!((of(0.1, 100.0, |d| d / 0.8) / (0.8 * TWO_SIDED) - 1.0).abs() < 0.02);
        // Flat on this side, and a fall that stays below what ends an interval.
        assert_eq!(of(1.0, 3.0, |_| 0.0), f64::INFINITY);
        assert_eq!(of(1.0, 30.0, |d| d.min(1.0)), f64::INFINITY);
    }
}
