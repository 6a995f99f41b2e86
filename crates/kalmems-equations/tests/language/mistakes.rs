//! What a reader gets wrong, and what is said of it. Each snapshot is the whole message.

use crate::common::example_text;
use kalmems_equations::{Description, Device};

/// The example with some text in another's place, and what is said of it: an error or notices.
fn said(example: &str, changes: &[(&str, &str)]) -> String {
    let mut text = example_text(example);
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    said_of(&text)
}

fn said_of(text: &str) -> String {
    match Description::read(text).and_then(|read| Device::of(&read)) {
        Err(error) => error.to_string(),
        Ok(device) => {
            let notices: Vec<String> =
                device.notices().iter().map(|notice| format!("notice: {notice}")).collect();
            if notices.is_empty() { "nothing".to_owned() } else { notices.join("\n") }
        }
    }
}

/// The scanner with one text changed.
fn scanner(from: &str, to: &str) -> String {
    said("shared_scanner", &[(from, to)])
}

/// A device of one state, with more tables.
fn small(tables: &str) -> String {
    said_of(&format!("[states]\nx = 'm'\n[parameters]\np = '2 m'\nrate = '3 1/s'\n{tables}"))
}

/// A device of one state with this rate.
fn rate(text: &str) -> String {
    small(&format!("[derivative]\nx = '{text}'\n"))
}

/// Three states with this rate, in which `i` is the index.
fn chain(text: &str) -> String {
    said_of(&format!(
        "[states]\n'x[1..3]' = 'm'\n[parameters]\nk = '3 1/s'\n[derivative]\n'x[i=1..3]' = '{text}'\n"
    ))
}

/// A device of one state with this rate, which a surface of a length and a rate gives; and with this first row of its values.
fn surface(text: &str, row: &str) -> String {
    small(&format!(
        "[inputs]\nu = '1/s'\n[tables]\nS = {{ x = [0, 1, 2, 3], y = [0, 2, 4, 8], z = [{row}, [1, 2, 3, 4], [0, 1, 2, 1], [1, 1, 0, 2]], \
         x_unit = 'm', y_unit = '1/s', z_unit = 'm/s' }}\n[derivative]\nx = '{text}'\n"
    ))
}

macro_rules! mistakes {
    ($($name:ident: $said:expr;)+) => {
        $(
            #[test]
            fn $name() {
                insta::assert_snapshot!($said);
            }
        )+
    };
}

mistakes! {
    right_is_right: scanner("theta = \"omega\"", "theta = \"omega\"");

    // Units.
    unit_of_a_sum: scanner("b*omega - k*theta)", "b*theta - k*theta)");
    rates_of_two_states_in_the_other_order: said("shared_scanner", &[("theta = \"omega\"", "was = \"omega\""), ("omega = \"(", "theta = \"("), ("was = ", "omega = ")]);
    unit_of_a_parameter: scanner("J = \"1.15e-14 kg m^2\"", "J = \"1.15e-14 kg m\"");
    unit_that_is_none: scanner("b = \"5.95e-12 N m s\"", "b = \"5.95e-12 N m sec\"");
    value_without_a_number: scanner("J = \"1.15e-14 kg m^2\"", "J = \"small\"");
    unit_of_a_state_is_none: scanner("theta = \"rad\"", "theta = \"radd\"");
    unit_of_a_measurement: scanner("offset) in V", "offset) in pF");
    measurement_without_a_unit: scanner("offset) in V", "offset)");
    unit_missing_behind_in: scanner("offset) in V", "offset) in");
    unit_of_an_exponential: scanner("gaussian_comb(theta, C0, width, Cb)", "C0*exp(-theta^2/width) + Cb");
    unit_of_a_logarithm: rate("p*rate*ln(x)");
    unit_of_a_sine: rate("p*rate*sin(x)");
    unit_of_an_arc_sine: rate("p*rate*asin(x)");
    units_of_an_arc_tangent: rate("p*rate*atan2(x, rate)");
    arc_sine_beyond_one: rate("p*rate*asin(1.5)");
    angle_in_an_exponential: rate("p*rate*exp(atan2(x, p))");
    unit_of_a_whole_number: rate("rate*floor(x)");
    unit_of_a_length: rate("p*hypot(x, p)");
    unit_of_a_law: scanner("gaussian_comb(theta, C0, width, Cb)", "gaussian_comb(theta, C0, J, Cb)");
    arguments_of_a_law_in_another_order: scanner("(theta, C0, width, Cb)", "(theta, width, C0, Cb)");
    unit_of_an_exponent: rate("rate*p*2^x");
    power_of_a_unit: rate("rate*p*x^rate");
    third_root_of_a_unit: rate("rate*x^(1/3)*p^(2/3)");
    unit_of_a_comparison: rate("if(x < rate, rate*x, 0)");
    unit_of_the_branches: rate("if(x < p, rate*x, p)");
    unit_of_a_minimum: rate("rate*min(x, rate)");
    missing_two_pi: said("piston_mirror", &[("phi = \"2*pi*f\"", "phi = \"f\"")]);
    cycles_in_a_sine: small("[inputs]\nf = 'Hz'\n[derivative]\nx = 'rate*p*sin(f*3[s])'\n");
    resonance_in_hz: said_of("[states]\nx = 'm'\nv = 'm/s'\n[parameters]\nf = '10 kHz'\nQ = '50'\n[derivative]\nx = 'v'\nv = '-f^2*x - f/Q*v'\n[measure]\ny = 'x in m'\n");
    corner_in_hz: small("corner = '1 kHz'\n[derivative]\nx = 'corner*(p - x)'\n");
    angular_rate_times_two_pi: said_of("[states]\nphi = 'rad'\n[parameters]\nomega = '3 rad/s'\n[derivative]\nphi = '2*pi*omega'\n[measure]\ny = 'phi in rad'\n");
    resonance_with_two_pi_is_right: small("f = '10 kHz'\n[let]\nw = '2*pi*f'\n[derivative]\nx = '-w*x + (2*pi*f)^2*x/w - w^2*x/(3*w) + p*sin(2*pi*f*1[s])*rate'\n");
    unit_of_a_noise: scanner("1e8[rad^2/s^3]", "1e8[rad/s^2]");
    unit_of_a_measurement_noise: scanner("1.92e-4[V^2]", "1.92e-4[V]");
    unit_of_a_period: said("piston_mirror", &[("phi = \"2*pi\"", "phi = \"1[m]\"")]);
    unit_of_a_time_constant: said("shared_scanner_low_passed", &[("time = \"1/first_pole\"", "time = \"first_pole\"")]);

    resonance_of_a_number_in_hz: said_of("[states]\nx = 'm'\nv = 'm/s'\n[derivative]\nx = 'v'\nv = '-(1200[Hz])^2*x'\n[measure]\ny = 'x in m'\n");
    resonance_of_a_number_in_hz_with_two_pi_is_right: said_of("[states]\nx = 'm'\nv = 'm/s'\n[derivative]\nx = 'v'\nv = '-(2*pi*1200[Hz])^2*x - 3[1/s]*v'\n[measure]\ny = 'x in m'\n");
    parameter_without_a_unit: said_of("[states]\nomega = 'rad/s'\n[inputs]\nI = 'A'\n[parameters]\nJ = '2e-9 kg m^2'\nb = '1e-9 N m s'\nKt = '3e-5'\n[derivative]\nomega = '(Kt*I - b*omega)/J'\n");
    parameter_without_a_unit_below_the_bar: said_of("[states]\nx = 'V'\n[inputs]\nu = 'V'\n[parameters]\ntau = '0.002'\n[derivative]\nx = '(u - x)/tau'\n");
    parameters_without_units: said_of("[states]\nx = 'm'\n[parameters]\na = '3'\nq = '5'\n[derivative]\nx = 'a*x*exp(-q)'\n");

    surface_of_one_argument: surface("S(x)", "[3, 4, 5, 6]");
    unit_of_the_second_argument: surface("S(x, x)", "[3, 4, 5, 6]");
    row_of_a_surface: surface("S(x, 2*rate)", "[3, 4, 5]");
    third_derivative_of_a_surface: surface("d(d(d(S(x, u), x), u), u)*1[m/s^2]", "[3, 4, 5, 6]");

    // Vectors.
    element_beyond_a_vector: chain("k*(x[i+1] - x[i])");
    element_below_a_vector: chain("k*(x[i] - x[i-2])");
    index_that_is_none: chain("k*x[j]");
    sum_without_a_range: chain("sum(j, x[j])*1[m/s]");
    vector_twice: said_of("[states]\n'x[1..3]' = 'm'\nx_2 = 'm'\n[derivative]\n'x[1..3]' = '1[m/s]'\n");
    range_that_falls: said_of("[states]\n'x[3..1]' = 'm'\n");

    // Names.
    misspelt_name: scanner("- b*omega", "- b*omga");
    name_of_another_case: scanner("d(C, theta)", "d(c, theta)");
    misspelt_function: scanner("gaussian_comb(", "gausian_comb(");
    function_that_is_a_parameter: scanner("k*theta)", "k(theta))");
    law_without_arguments: rate("rate*p*sqrt");
    wrong_number_of_arguments: scanner("(theta, C0, width, Cb)", "(theta, C0, width)");
    wrong_number_for_a_function: rate("rate*p*exp(1, 2)");
    rate_of_an_unknown_state: scanner("omega = \"(electrostatic", "omgea = \"(electrostatic");
    state_without_a_rate: scanner("theta = \"omega\"\n", "");
    name_twice: scanner("k = \"1.10e-4 N m\"", "V = \"1.10e-4 N m\"");
    name_of_the_language: scanner("b = \"5.95e-12 N m s\"", "exp = \"5.95e-12 N m s\"");
    name_of_a_law: scanner("b = \"5.95e-12 N m s\"", "carrier = \"5.95e-12 N m s\"");
    name_with_a_space: scanner("b = \"5.95e-12 N m s\"", "\"b c\" = \"5.95e-12 N m s\"");
    unit_of_the_noise_of_an_event: small("[derivative]\nx = '-rate*x'\n[events]\npass = 'x - p'\n[noise]\npass = '1e-6[V^2]'\n");
    event_with_the_name_of_a_state: small("[derivative]\nx = '-rate*x'\n[events]\nx = 'x - p'\n");
    noise_of_nothing: scanner("signal = \"1.92e-4[V^2]\"", "signl = \"1.92e-4[V^2]\"");
    misspelt_table: scanner("[derivative]", "[derivatives]");
    no_states: said_of("[parameters]\nk = '1 N/m'\n");

    // Definitions.
    cycle: scanner("square = \"V^2 + carrier_square\"", "square = \"V^2 + C*square/C\"");
    longer_cycle: small("[let]\na = 'b'\nb = '2*c'\nc = 'a + x'\n[derivative]\nx = 'rate*a'\n");
    function_that_calls_itself: small("[functions]\n'f(y)' = 'y + f(y)'\n[derivative]\nx = 'rate*f(x)'\n");
    error_in_a_function: small("[functions]\n'f(y)' = 'y + 1[s]'\n[derivative]\nx = 'rate*f(x)'\n");
    function_without_arguments: small("[functions]\nf = '2'\n[derivative]\nx = 'rate*x'\n");
    rate_that_needs_itself: small("[derivative]\nx = 'ddt(x) + rate*x'\n");

    // Grammar.
    missing_bracket: scanner("- k*theta)/J", "- k*theta/J");
    bracket_too_many: scanner("- k*theta)/J", "- k*theta))/J");
    missing_operator: scanner("b*omega", "b omega");
    operator_at_the_end: scanner("- k*theta)/J", "- k*theta)/");
    sign_of_typesetting: scanner("- b*omega", "− b*omega");
    raised_two: scanner("V^2 + carrier", "V² + carrier");
    equation: scanner("theta = \"omega\"", "theta = \"dtheta = omega\"");
    empty: rate("");
    number_with_two_points: rate("1.2.3*rate*x");
    unit_bracket_open: rate("2[m/s");
    unit_in_brackets_is_none: rate("2[m/sec]");
    comparison_outside_of_if: rate("rate*x < p");
    if_without_comparison: rate("if(x, rate*x, 0)");
    value_among_conditions: rate("if(x < p and p, rate*x, 0)");
    value_before_a_condition: rate("if(x or x < p, rate*x, 0)");
    condition_within_a_sum: rate("rate*(x + (x < p))");
    two_comparisons_in_one: rate("if(0 < x < p, rate*x, 0)");
    conditions_as_the_whole: rate("x < p and p < x");
    functions_with_jumps: rate("rate*p*(sign(x) + floor(x/p) + atan2(x, p))");
    name_that_joins_conditions: small("and = '3 m'\n[derivative]\nx = '-rate*x'\n");
    too_deep: rate(&format!("{}rate*x{}", "(".repeat(70), ")".repeat(70)));
    not_toml: said_of("[states\nx = 'm'\n");
    number_for_a_text: small("[derivative]\nx = 3\n");

    // Derivatives.
    derivative_by_an_expression: small("[let]\ny = '2*x'\n[derivative]\nx = 'rate*x*d(y^2, y)/p'\n");
    derivative_by_nothing: scanner("d(C, theta)", "d(C, thet)");
    derivative_without_a_name: scanner("d(C, theta)", "d(C)");
    rate_of_the_rate_of_an_input: said("shared_scanner", &[("gain, offset) in V", "gain, offset) + 1[V s^2/V^2]*ddt(ddt(square)) in V")]);
    name_of_the_rate_of_an_input: said(
        "shared_scanner",
        &[("[let]\n", "[let]\nV_rate = \"0[V/s]\"\n"), ("gain, offset) in V", "gain, offset) + 1[V s/V^2]*ddt(square) in V")]
    );
    quantity_without_a_unit: small("[derivative]\nx = '-rate*x'\n[quantities]\ntwice = '2*x'\n");
    quantity_of_no_state: small("[derivative]\nx = '-rate*x'\n[quantities]\nfixed = '2[m] in m'\n");
    quantity_with_the_name_of_a_state: small("[derivative]\nx = '-rate*x'\n[quantities]\nx = '2*x in m'\n");
    derivative_of_a_high_order: scanner("d(C, theta)", "width^3*d(d(d(d(C, theta), theta), theta), theta)");

    // What is known before anything runs.
    measurement_of_no_state: scanner("demodulated(C, gain, offset) in V", "gain*C0 + offset in V");
    event_of_no_state: said("threshold_scanner", &[("theta - threshold\"", "2*threshold\"")]);
    division_by_zero: rate("rate*x/0");
    logarithm_of_zero: rate("rate*x*ln(0)");
    kink: rate("-rate*abs(x)");
    kink_of_if: rate("if(x < p, rate*x, rate*p)");
    period_of_a_state: said("piston_mirror", &[("phi = \"2*pi\"", "phi = \"2*pi + phi\"")]);
    curve_that_falls: small("[tables.C]\nx = [0, 2, 1, 3]\ny = [1, 2, 3, 4]\nx_unit = 'm'\ny_unit = 'F'\n[derivative]\nx = 'rate*x'\n");
    curve_of_two_points: small("[tables.C]\nx = [0, 2]\ny = [1, 2]\nx_unit = 'm'\ny_unit = 'F'\n[derivative]\nx = 'rate*x'\n");
    unit_of_a_place: small("[tables.C]\nx = [0, 1, 2, 3]\ny = [1, 2, 3, 4]\nx_unit = 'um'\ny_unit = 'F'\n[derivative]\nx = 'C(rate)*x*1[1/F/s]'\n");
    rule_for_outside: small("[tables.C]\nx = [0, 1, 2, 3]\ny = [1, 2, 3, 4]\nx_unit = 'um'\ny_unit = 'F'\noutside = 'clip'\n[derivative]\nx = 'rate*x'\n");
    delay_of_the_third_order: small("[derivative]\nx = '-rate*x'\n[delay]\nlate = { of = 'x in m', time = '1[s]', order = 3 }\n");
}
