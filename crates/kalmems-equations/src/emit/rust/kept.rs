//! What a filter in Rust does once it has lost its signal or its numbers.

use super::{kind, typed};
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{CallTargets, Interface, UpdateFunction, further};
use crate::emit::request::EmitRequest;
use std::fmt::Write as _;

/// What becomes of a filter after a sample.
const RECOVER: &str = "
    /// Goes on from the state that is kept if that predicts the signal, and begins again if the filter is lost.
    fn recover(&mut self) {
        let means = self.state.mean.iter().zip(&self.kept.mean).map(|(own, kept)| [*own as f32, *kept as f32]);
        match self.loss.recovery(&RULES, &self.watch, is_finite(&self.kept), is_alike(means)) {
            LossOutcome::None => {}
            LossOutcome::Kept => {
                self.state = self.kept;
                self.watch = [RULES.settled(); MEASUREMENTS];
            }
            LossOutcome::Again => self.restart(),
            LossOutcome::GivenUp => self.begun = self.begun.wrapping_add(1),
        }
    }

    /// Keeps the filter as it is before a correction with which its gate has opened.
    fn keep(&mut self) {
        if self.loss.opens(&RULES, &self.watch) {
            self.kept = self.state;
        }
    }

    /// Whether too many samples are none of the signal, or something is kept since they were.
    #[inline(always)]
    fn is_open(&self) -> bool {
        self.loss.is_open(&self.watch)
    }
";

/// How it begins again with what it has kept.
const RESTART: &str = "
    /// Begins again: in turn with the means that it has kept and the covariance of the start, and as at the start.
    fn restart(&mut self) {
        self.state = START;
        self.watch = [InnovationWatch::NEW; MEASUREMENTS];
        self.left = 0;
        match self.loss.begins(&RULES, is_finite(&self.kept)) {
            Beginning::Kept => {
                self.state.mean = self.kept.mean;
                self.watch = [RULES.anew(); MEASUREMENTS];
            }
            Beginning::Start => {}
            Beginning::Unknown => self.begun = self.begun.wrapping_add(1),
        }
    }
";

/// How it begins again without.
const RESTART_AT_START: &str = "
    /// Begins again as at the start, and counts it.
    fn restart(&mut self) {
        self.state = START;
        self.watch = [InnovationWatch::NEW; MEASUREMENTS];
        self.left = 0;
        self.begun = self.begun.wrapping_add(1);
    }
";

/// How it begins again.
pub(super) fn restart(request: &EmitRequest) -> &'static str {
    if request.begins_again() { RESTART } else { RESTART_AT_START }
}

/// The methods that go on with what is kept, and those that it shares with the filter.
pub(super) fn methods<'p>(
    program: &FilterProgram,
    interface: &Interface,
    updates: impl Iterator<Item = UpdateFunction<'p>>,
) -> String {
    let over = |state, watch| CallTargets { state, watch, constants: "&self.constants" };
    let mut text = RECOVER.to_owned();
    let mut looks = String::new();
    for update in updates.filter(|update| !update.is_event) {
        let (of, arguments) = (&update.name, update.arguments());
        let one =
            update.routine.call(&format!("{of}_alone"), &over("&mut self.kept", "&mut look"), &arguments);
        let _ = write!(
            text,
            "\n    fn look_by_{of}(&mut self{}) {{\n        if self.loss.is_kept(&RULES) {{\n            let mut look = self.loss.look(&RULES);\n            \
             let _ = {one};\n            self.loss.looked(&look);\n        }}\n    }}\n",
            typed(&arguments)
        );
        let _ = writeln!(looks, "        self.look_by_{of}({});", arguments.join(", "));
    }
    let all: Vec<String> = interface.step.iter().chain(&interface.measured).cloned().collect();
    let _ = write!(
        text,
        "\n    /// Goes on with what is kept by a sample.\n    fn go_on(&mut self{}) {{\n        if self.loss.is_kept(&RULES) {{\n            {};\n        \
         }}\n{looks}    }}\n\n    /// One interval on.\n    fn predicted(&mut self{}) -> bool {{\n        let mut next = self.state;\n        {};\n        \
         if self.take(&next) {{\n            return true;\n        }}\n        self.restart();\n        false\n    }}\n",
        typed(&all),
        program.predict.call("predict_alone", &over("&mut self.kept", ""), &interface.predict),
        typed(&interface.predict),
        program.predict.call("predict_alone", &over("&mut next", ""), &interface.predict)
    );
    text
}

/// The functions that the filter and what it has kept share.
pub(super) fn functions<'p>(
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
    updates: impl Iterator<Item = UpdateFunction<'p>>,
) -> String {
    let inner = CallTargets { state: "state", watch: "watch", constants: "constants" };
    let constants = match &program.configure {
        Some(configure) => {
            format!(", constants: &[{}; {}]", kind(program.widths.constants), configure.outputs.len())
        }
        None => String::new(),
    };
    let way = if request.parts > 1 { "advance" } else { "predict" };
    let mut text = format!(
        "\n/// The prediction of the filter or of what it has kept.\n#[inline(never)]\nfn predict_alone(state: &mut State{}{}) {{\n    {};\n}}\n",
        if program.predict.reads_constants() { &constants } else { "" },
        typed(&interface.predict),
        program.predict.call(way, &inner, &interface.predict)
    );
    for update in updates.filter(|update| !update.is_event) {
        let (of, routine, arguments) = (&update.name, update.routine, update.arguments());
        let _ = write!(
            text,
            "\n#[inline(never)]\nfn {of}_alone(state: &mut State, watch: &mut InnovationWatch{}{}) -> bool {{\n    {}\n}}\n",
            if routine.reads_constants() { &constants } else { "" },
            further(&arguments, "", ": f32"),
            routine.call(of, &inner, &arguments)
        );
    }
    text
}
