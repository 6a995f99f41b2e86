//! What a step of an exported source takes on a processor.

use crate::CommandEnding;
use crate::args::{ExportArguments, Processor};
use kalmems::export::{Exported, SourceCost};
use kalmems::inspect::quantity;
use kalmems::units::{Kind, Value, kind};

/// Cycles for each instruction, memory without wait states.
const CYCLES: f64 = 2.0;

/// Instructions for each operation in 32 and in 64 bits: a sum, a product, a division, a function and a choice; for each mean and entry of the
/// covariance; and for each measurement, whose innovations are watched.
struct OperationWeights {
    narrow: [f64; 5],
    wide: [f64; 5],
    number: f64,
    measurement: f64,
}

impl Processor {
    const fn weights(self) -> OperationWeights {
        match self {
            Self::CortexM4f => M4F,
            Self::CortexM7 => M7,
            Self::CortexM0plus => M0_PLUS,
            Self::Rv32imfc => RV32IMFC,
        }
    }
}

/// Fitted to twelve filters of the examples on emulated processors (arm-none-eabi-gcc 12.2 -O2): within 8 % of each on a Cortex-M4F, 18 % on an M7 and
/// 2 % on an M0+. The weights of divisions are assumed, and so are those of choices in 32 bits, which none of the filters has.
const M4F: OperationWeights = OperationWeights {
    narrow: [0.9, 0.9, 14.0, 57.0, 4.0],
    wide: [64.0, 64.0, 250.0, 514.0, 514.0],
    number: 0.0,
    measurement: 60.0,
};

const M7: OperationWeights = OperationWeights {
    narrow: [0.85, 0.85, 14.0, 40.0, 4.0],
    wide: [1.5, 1.5, 20.0, 282.0, 282.0],
    number: 10.0,
    measurement: 60.0,
};

const M0_PLUS: OperationWeights = OperationWeights {
    narrow: [99.0, 99.0, 300.0, 1660.0, 40.0],
    wide: [222.0, 222.0, 900.0, 1423.0, 1423.0],
    number: 78.0,
    measurement: 2941.0,
};

/// Fitted to 16 filters of the examples (riscv64-unknown-elf-gcc 12.2 -O2 for rv32imfc): within 11 % of each. Functions in 64 bits and choices are
/// assumed.
const RV32IMFC: OperationWeights = OperationWeights {
    narrow: [1.3, 1.3, 2.0, 32.0, 4.0],
    wide: [174.0, 174.0, 1000.0, 32.0, 30.0],
    number: 0.0,
    measurement: 83.0,
};

/// The instructions of a step, about.
pub fn instructions(cost: &SourceCost, processor: Processor) -> f64 {
    let weights = processor.weights();
    let sum = |counts: &[usize; 5], each: &[f64; 5]| -> f64 {
        counts.iter().zip(each).map(|(count, each)| *count as f64 * each).sum()
    };
    sum(&cost.in_32_bits, &weights.narrow)
        + sum(&cost.in_64_bits, &weights.wide)
        + weights.number * cost.numbers as f64
        + weights.measurement * cost.measurements as f64
}

/// What is said of the cost; refuses a source that does not fit the budget.
pub fn said(exported: &Exported, arguments: &ExportArguments) -> Result<Vec<String>, CommandEnding> {
    let Some(cost) = &exported.cost else {
        return match arguments.cpu {
            None => Ok(Vec::new()),
            Some(_) => Err(CommandEnding::Wrong(
                "--cpu: the operations of this source are not counted; leave it out".to_owned(),
            )),
        };
    };
    let counts = |[sums, products, divisions, calls, choices]: [usize; 5]| {
        format!(
            "{sums} sums, {products} products, {divisions} divisions, {calls} functions, {choices} choices"
        )
    };
    let mut words =
        vec![format!("a step takes {}; the filter has {} bytes", counts(cost.in_32_bits), cost.bytes)];
    if cost.in_64_bits.iter().any(|count| *count > 0) {
        words.push(format!("and in 64 bits {}", counts(cost.in_64_bits)));
    }
    let Some(processor) = arguments.cpu else { return Ok(words) };
    let instructions = instructions(cost, processor);
    words.push(format!("about {} instructions a step", (0.1 * instructions).round() * 10.0));
    let Some(clock) = &arguments.clock else { return Ok(words) };
    let clock_hz = positive("clock", clock, &kind::FREQUENCY, "168 MHz")?;
    let step_s = CYCLES * instructions / clock_hz;
    words.push(format!(
        "about {} a step at {clock}, at two cycles for each instruction",
        quantity(step_s, "s")
    ));
    if let Some(budget) = &arguments.budget {
        let budget_s = positive("budget", budget, &kind::TIME, "10 us")?;
        if step_s > budget_s {
            return Err(CommandEnding::Wrong(format!(
                "--budget: a step takes about {}, and {budget} are there; {}",
                quantity(step_s, "s"),
                cheaper(cost)
            )));
        }
    }
    Ok(words)
}

/// What would take less.
fn cheaper(cost: &SourceCost) -> String {
    let mut ways = Vec::new();
    if cost.in_64_bits.iter().any(|count| *count > 0) {
        ways.push("`--digits single`, if the rehearsal allows it");
    }
    ways.push("the method `steady_state`, whose gain is constant");
    ways.push("the method `euler_ekf` with more process noise");
    ways.push("a lower `--rate`");
    format!("try {}", ways.join(", "))
}

/// A positive number of a unit.
fn positive(option: &str, text: &str, of: &'static Kind, example: &str) -> Result<f64, CommandEnding> {
    let wrong = |why: &dyn std::fmt::Display| CommandEnding::Wrong(format!("--{option}: {why}"));
    let value = Value::parse(text).map_err(|e| wrong(&e))?.of_kind(of).map_err(|e| wrong(&e))?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(wrong(&format!("found `{text}`; write a value above 0, such as `{example}`")))
    }
}
