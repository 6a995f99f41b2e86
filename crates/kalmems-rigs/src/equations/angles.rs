//! States that are angles of a swing, of which amplitude, phase and peaks are told.

use super::names::kind_of;
use super::table::EquationsTable;
use crate::config::{ConfigError, ConfigFault, Experiment, Key};
use crate::units::{Interner, kind, name};
use kalmems_equations::Device;

/// The names of the angles and of their rates.
pub fn angles(table: &EquationsTable) -> &'static [[&'static str; 2]] {
    static KNOWN: Interner<[[&'static str; 2]]> = Interner::new();
    let all: Vec<_> = table.angles.iter().map(|(angle, rate)| [name(angle), name(rate)]).collect();
    KNOWN.get(&all, || all.clone().into())
}

/// Refuses what is no angle of the device, or has another rate.
pub fn check(experiment: &Experiment, table: &EquationsTable, device: &Device) -> Result<(), ConfigError> {
    for (angle, rate) in table.angles.iter() {
        let at = Key::from("device.equations.angles").child(angle);
        let refuse = |why: String| Err(experiment.error(at.clone(), ConfigFault::Value { why }));
        let states = device.states().iter().take(device.own_states());
        let Some(state) = states.clone().find(|named| *named.name == *angle) else {
            return Err(
                experiment.error(at, ConfigFault::unknown_key(angle, states.map(|named| &*named.name)))
            );
        };
        if kind_of(state).name != kind::ANGLE.name {
            return refuse(format!(
                "`{angle}` is stated in {}; expected an angle, such as one in rad",
                state.unit_text
            ));
        }
        let stated = table.derivative.get(angle).map_or("", |text| text.trim());
        if stated != rate.trim() {
            return refuse(format!(
                "the rate of `{angle}` is `{stated}`; expected a state, named here as well, and found `{rate}`"
            ));
        }
    }
    Ok(())
}
