//! The published laws as functions of the language.
//!
//! Laws with an exponential, a root or a series are nodes of their own, computed by `kalmems-models` with their
//! derivatives; those that are a line of arithmetic are written in the language itself.

pub(crate) mod disks;
mod native;
mod prelude;

pub(crate) use native::{MOST_ARGUMENTS, along_first, along_first_of_four, gaussian_along_first, partial};
pub(crate) use prelude::PRELUDE;

use crate::quantity::Quantity;
use kalmems_units::Unit;

/// A native law, by its place in [`LAWS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum LawId {
    GaussianComb,
    LogisticComb,
    LogisticCombChange,
    TiltingPlate,
    Carrier,
    Disks,
    Atanhc,
}

/// What unit an argument must have.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wanted {
    /// This one.
    Unit(&'static str),
    /// Any, which others refer to.
    Free,
    /// That of another argument, angle included.
    As(usize),
    /// One over that of another argument, angle included.
    Inverse(usize),
}

/// A native law as texts use it.
pub(crate) struct Law {
    pub(crate) id: LawId,
    pub(crate) name: &'static str,
    pub(crate) arguments: &'static [(&'static str, Wanted)],
    /// The unit of the value: a unit, or that of an argument.
    pub(crate) value: Wanted,
    /// The law as a reader knows it.
    pub(crate) formula: &'static str,
}

/// All native laws.
pub(crate) static LAWS: &[Law] = &[
    Law {
        id: LawId::GaussianComb,
        name: "gaussian_comb",
        arguments: &[
            ("angle", Wanted::Free),
            ("nominal", Wanted::Free),
            ("width", Wanted::As(0)),
            ("bias", Wanted::As(1)),
        ],
        value: Wanted::As(1),
        formula: "nominal·exp(−(angle/width)²) + bias",
    },
    Law {
        id: LawId::LogisticComb,
        name: "logistic_comb",
        arguments: &[
            ("angle", Wanted::Free),
            ("centre", Wanted::As(0)),
            ("gain", Wanted::Free),
            ("steepness", Wanted::Inverse(0)),
        ],
        value: Wanted::As(2),
        formula: "gain·(1/(1 + exp(−u)) − 1/2), u = steepness·(angle − centre)",
    },
    Law {
        id: LawId::LogisticCombChange,
        name: "logistic_comb_change",
        arguments: &[
            ("angle", Wanted::Unit("rad")),
            ("centre", Wanted::Unit("rad")),
            ("gain", Wanted::Unit("V s/rad")),
            ("steepness", Wanted::Unit("1/rad")),
            ("transimpedance", Wanted::Unit("V ohm")),
        ],
        value: Wanted::Unit("F"),
        formula: "−∫logistic_comb/transimpedance over the angle, from centre to angle",
    },
    Law {
        id: LawId::TiltingPlate,
        name: "tilting_plate",
        arguments: &[
            ("angle", Wanted::Unit("rad")),
            ("near", Wanted::Unit("m")),
            ("far", Wanted::Unit("m")),
            ("along", Wanted::Unit("m")),
            ("gap", Wanted::Unit("m")),
            ("permittivity", Wanted::Unit("F/m")),
        ],
        value: Wanted::Unit("F"),
        formula: "permittivity·along·∫dw/(gap − w·tan angle), w from near to far",
    },
    Law {
        id: LawId::Carrier,
        name: "carrier",
        arguments: &[
            ("capacitance", Wanted::Unit("F")),
            ("excitation", Wanted::Free),
            ("carrier_rate", Wanted::Unit("rad/s")),
            ("shunt_conductance", Wanted::Unit("S")),
            ("parallel_capacitance", Wanted::Unit("F")),
            ("input_conductance", Wanted::Unit("S")),
            ("blocking_capacitance", Wanted::Unit("F")),
        ],
        value: Wanted::As(1),
        formula: "amplitude of the carrier behind capacitance into shunt, parallel and blocking capacitance and input",
    },
    Law {
        id: LawId::Disks,
        name: "disks",
        arguments: &[("distance", Wanted::Unit("m")), ("radius", Wanted::Unit("m"))],
        value: Wanted::Unit("F"),
        formula: "two equal coaxial disks with their fringing field (Love, 1949)",
    },
    Law {
        id: LawId::Atanhc,
        name: "atanhc",
        arguments: &[("z", Wanted::Unit("1"))],
        value: Wanted::Unit("1"),
        formula: "atanh(z)/z",
    },
];

/// The law of this name.
pub(crate) fn of_name(name: &str) -> Option<&'static Law> {
    LAWS.iter().find(|law| law.name == name)
}

/// The name of a law.
pub(crate) fn name(id: LawId) -> &'static str {
    LAWS.iter().find(|law| law.id == id).map_or("", |law| law.name)
}

/// The highest order of a derivative by these arguments: one more where the first argument is among them, whose derivative
/// the models state.
pub(crate) fn highest_order(by: &[u8]) -> usize {
    if by.contains(&0) { 3 } else { 2 }
}

/// Whether a law has this derivative.
pub(crate) fn has_derivative(_: LawId, by: &[u8]) -> bool {
    by.len() <= highest_order(by)
}

impl Law {
    /// The unit of the value; or which argument has a wrong one, its own, the one wanted and why.
    pub(crate) fn check(&self, found: &[Quantity]) -> Result<Quantity, (usize, String, String)> {
        for (index, ((_, wanted), have)) in self.arguments.iter().zip(found).enumerate() {
            let (expected, because) = match wanted {
                Wanted::Free => continue,
                Wanted::Unit(unit) => (unit_of(unit), format!("`{}` expects there", self.name)),
                Wanted::As(other) => (Some(at(found, *other)), format!("`{}` has", self.argument(*other))),
                Wanted::Inverse(other) => (
                    Quantity::PLAIN.over(at(found, *other)),
                    format!("is one over that of `{}`", self.argument(*other)),
                ),
            };
            let expected = expected.unwrap_or(Quantity::Any);
            // Sensitivities and rates are written with rad and without; shapes are not.
            let strict = !matches!(wanted, Wanted::Unit(unit) if !matches!(*unit, "rad" | "1/rad" | "1"));
            let fits = match (*have, expected) {
                (Quantity::Any, _) | (_, Quantity::Any) => true,
                (Quantity::Exact(a), Quantity::Exact(b)) if strict => a == b,
                _ => have.plus(expected).is_some(),
            };
            if !fits {
                return Err((index, expected.to_string(), because));
            }
        }
        Ok(match self.value {
            Wanted::Unit(unit) => unit_of(unit).unwrap_or(Quantity::Any),
            Wanted::As(other) | Wanted::Inverse(other) => at(found, other),
            Wanted::Free => Quantity::Any,
        })
    }

    /// The law with the names of its arguments.
    pub(crate) fn header(&self) -> String {
        let names: Vec<&str> = self.arguments.iter().map(|(name, _)| *name).collect();
        format!("{}({})", self.name, names.join(", "))
    }

    pub(crate) fn argument(&self, index: usize) -> &'static str {
        self.arguments.get(index).map_or("", |(name, _)| name)
    }
}

fn at(found: &[Quantity], index: usize) -> Quantity {
    found.get(index).copied().unwrap_or(Quantity::Any)
}

fn unit_of(unit: &str) -> Option<Quantity> {
    Unit::parse(unit).ok().map(|unit| Quantity::Exact(unit.dimension()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_of_a_law_is_one() {
        for law in LAWS {
            assert!(law.arguments.len() <= MOST_ARGUMENTS, "{}", law.name);
            for wanted in law.arguments.iter().map(|(_, wanted)| wanted).chain([&law.value]) {
                if let Wanted::Unit(unit) = wanted {
                    assert!(unit_of(unit).is_some(), "{}: {unit}", law.name);
                }
            }
            assert_eq!(name(law.id), law.name);
        }
    }
}
