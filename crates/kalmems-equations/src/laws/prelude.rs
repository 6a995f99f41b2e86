//! Laws that are a line of arithmetic, in the language itself.

/// Functions with their arguments, and what they are.
///
/// `tests/laws.rs` holds each to the law of `kalmems-models` of which it is the formula.
pub(crate) static PRELUDE: &[(&str, &str)] = &[
    // Faller and Zangl, 2017, equation 1.
    (
        "parallel_plate(distance, area, relative_permittivity)",
        "8.8541878128e-12[F/m]*relative_permittivity*area/distance",
    ),
    // Chen et al., shared electrodes, 2020, equation 8: from dC/dθ and the mean square of the voltage.
    ("electrostatic_force(slope, square)", "0.5*slope*square"),
    ("viscous_damping(damping, rate)", "damping*rate"),
    // Zhang, 2010, equation 2-14 with its sign put right: the coefficient at x/d₀, of which a share is squeezed gas.
    (
        "squeeze_film(share, damping, squeezed)",
        "damping*(1 + squeezed*(0.5*((1 - share)^-3 + (1 + share)^-3) - 1))",
    ),
    // Duffing's spring.
    ("cubic_spring(x, linear, cubic)", "x*(linear + cubic*x^2)"),
    // Chen et al., shared electrodes, 2020, equations 19 and 20.
    (
        "transimpedance(capacitance, capacitance_rate, voltage, voltage_rate, resistance, parasitic)",
        "resistance*(capacitance_rate*voltage + (capacitance + parasitic)*voltage_rate)",
    ),
    // Chen et al., shared electrodes, 2020, equations 25 to 27.
    ("demodulated(capacitance, gain, offset)", "gain*capacitance + offset"),
    // Zhang, 2010, equation 2-8: C₁ − C₂.
    ("differential_plates(x, area, gap, permittivity)", "2*permittivity*area*x/((gap - x)*(gap + x))"),
    // Zhang, 2010, equation 2-15, with the mean squares of the voltages to both plates.
    (
        "differential_force(x, area, gap, permittivity, near_square, far_square)",
        "0.5*permittivity*area*(near_square/(gap - x)^2 - far_square/(gap + x)^2)",
    ),
    // Zhang, 2010, equations 2-7 and 2-9: from C₁ − C₂, the carrier's amplitude and C₄.
    ("charge_amplifier(difference, carrier_amplitude, feedback)", "difference*carrier_amplitude/feedback"),
];
