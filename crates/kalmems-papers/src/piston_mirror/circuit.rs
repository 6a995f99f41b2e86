//! The noise of the front end.

use super::published::circuit;
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use kalmems_models::capacitance::VACUUM_PERMITTIVITY;
use kalmems_models::readout::CarrierDivider;
use std::f64::consts::{PI, TAU};

/// P equations 5 to 8.
pub static HEAD: ItemHead = ItemHead {
    key: "front-end",
    title: "noise of the front end as a capacitance",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "P", label: "Equation 5", page: "section II-D" }],
    origin: ValueOrigin::Computed,
};

/// P equation 6 as it is printed, in V/F.
fn printed_slope() -> f64 {
    let circuit =
        (circuit::EXCITATION, circuit::CARRIER_HZ, circuit::SHUNT, circuit::PARASITIC, circuit::BASE);
    let (excitation, f, shunt, parasitic, base) = circuit;
    let load = 8.0 * PI * parasitic * f;
    let bracket = 1.0 / (shunt + load) + 1.0 / (8.0 * base * PI * f);
    excitation / (8.0 * base * base * 2.0 * PI * f * (1.0 / shunt + load) * bracket * bracket)
}

/// The density, three ways.
#[allow(clippy::unnecessary_wraps)] // the signature of every part
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let divider = CarrierDivider {
        excitation: circuit::EXCITATION,
        carrier_rate: TAU * circuit::CARRIER_HZ,
        shunt_conductance: 1.0 / circuit::SHUNT,
        parallel_capacitance: circuit::PARASITIC,
        input_conductance: 0.0,
        blocking_capacitance: 1.0,
    };
    let exact = divider.capacitance_noise(circuit::VOLTAGE_NOISE, circuit::BASE);
    let printed = circuit::VOLTAGE_NOISE / printed_slope();
    let paper = circuit::NOISE * 1e18;
    let area = circuit::BASE * 1e-3 / VACUUM_PERMITTIVITY;
    Ok(vec![
        Item::new(&HEAD)
            .check(Check::value("C_n by equations 7 and 8, put right", "aF/√Hz", paper, SeedSpread::exact(exact * 1e18), CheckTolerance::digit(1e-3)))
            .check(Check::value("C_n by equation 6 as printed", "aF/√Hz", paper, SeedSpread::exact(printed * 1e18), CheckTolerance::digit(1e-3)))
            .remark(format!(
                "Equation 8 prints an admittance as an impedance. With Z_p = 1/(1/R_s + jωC_p) the divider of equation 7 has \
                 a slope of {:.2e} V/F, and 2.09 nV/√Hz are {:.3} aF/√Hz, or {:.3} if the 1 V is an amplitude. Equation 6 as \
                 printed gives {:.3}: from none of them follows the printed 0.151, which is the noise of all its figures.",
                divider.slope(circuit::BASE),
                exact * 1e18,
                exact * 2_f64.sqrt() * 1e18,
                printed * 1e18
            ))
            .remark(format!(
                "The base capacitance of 109.3 fF at 1 mm is a parallel plate of {:.2} mm². With fringing fields the disk is \
                 smaller, and C(d) flatter than 1/d.",
                area * 1e6
            )),
    ])
}
