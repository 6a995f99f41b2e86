//! Signs and half turns that the signals do not tell and nothing states.

use crate::estimate::{Trajectory, TrajectoryKind};
use serde::Serialize;

/// The states of which the signals do not tell one branch from the other.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ArbitraryBranches {
    /// Whose sign is arbitrary, the first of each that change it together.
    #[serde(rename = "arbitrary_signs", skip_serializing_if = "Vec::is_empty")]
    pub signs: Vec<&'static str>,
    /// Which come round and may be half a period later, without another sign of any state.
    #[serde(rename = "arbitrary_half_turns", skip_serializing_if = "Vec::is_empty")]
    pub half_turns: Vec<&'static str>,
    /// Which turn together by any angle.
    #[serde(rename = "arbitrary_turns", skip_serializing_if = "Vec::is_empty")]
    pub turns: Vec<Vec<&'static str>>,
}

impl ArbitraryBranches {
    /// Those of some of these answers; a model alone follows no signal.
    pub(super) fn of(trajectories: &[Trajectory]) -> Self {
        let mut all = Self::default();
        for trajectory in trajectories.iter().filter(|one| one.kind != TrajectoryKind::ModelAlone) {
            for group in &trajectory.hidden_signs {
                let is_signed =
                    |place: &&usize| **place < trajectory.own_states && trajectory.period(**place).is_none();
                let signed = group.iter().find(is_signed);
                let state = signed.or(group.first()).and_then(|place| trajectory.states.get(*place));
                let names = if signed.is_some() { &mut all.signs } else { &mut all.half_turns };
                names.extend(state.map(|state| state.name).filter(|name| !names.contains(name)));
            }
            for turn in &trajectory.hidden_turns {
                let mut places: Vec<usize> = turn.iter().flat_map(|turned| turned.places).collect();
                places.dedup();
                let named = places.into_iter().filter_map(|place| Some(trajectory.states.get(place)?.name));
                let turn: Vec<&str> = named.collect();
                if !all.turns.contains(&turn) {
                    all.turns.push(turn);
                }
            }
        }
        all
    }

    /// Each of them in words, such as "the sign of `angle`".
    pub(super) fn in_words(&self) -> Vec<String> {
        let signs = self.signs.iter().map(|name| format!("the sign of `{name}`"));
        let half_turns = self.half_turns.iter().map(|name| format!("half a turn of `{name}`"));
        let turns = self.turns.iter().map(|turn| format!("a turn of {}", listed(turn, " and ")));
        signs.chain(half_turns).chain(turns).collect()
    }

    /// For what the signal is the same, and so what of the estimate is arbitrary; `None` if nothing.
    pub(super) fn sentence(&self) -> Option<String> {
        let [signs, half_turns] = [&self.signs, &self.half_turns].map(|names| listed(names, " and of "));
        let turns: Vec<String> = self.turns.iter().map(|turn| listed(turn, " and ")).collect();
        let same = [
            ("the other sign of ", signs),
            ("half a turn more of ", half_turns),
            ("any common turn of ", turns.join(", and of ")),
        ];
        let same: Vec<String> = (same.into_iter())
            .filter(|(_, names)| !names.is_empty())
            .map(|(what, names)| format!("{what}{names}"))
            .collect();
        let arbitrary = match (self.signs.is_empty(), same.len()) {
            (_, 0) => return None,
            (false, 1) => "the sign of the estimate",
            _ => "which of these the estimate has",
        };
        Some(format!("the signal is the same for {}: {arbitrary} is arbitrary", same.join(", and for ")))
    }
}

/// Names as code in a sentence.
fn listed(names: &[&str], between: &str) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(between)
}
