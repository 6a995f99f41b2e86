//! The mps2-an386 board as QEMU emulates it: start, output to the machine around it, and a count of instructions.

use crate::runs::Run;
use core::arch::{asm, global_asm};
use core::hint::black_box;

global_asm!(
    // The initial stack and where to begin.
    ".section .vectors, \"a\"",
    ".word _stack_top",
    ".word reset + 1",
    ".text",
    ".thumb_func",
    ".global reset",
    "reset:",
    // Access to the floating-point unit.
    "ldr r0, =0xE000ED88",
    "ldr r1, [r0]",
    "orr r1, r1, #0xF00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "bl main",
    "b .",
);

unsafe extern "C" {
    fn a_panic_path_survived() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: there is no such function: with a panic left in the program it would not link.
    unsafe { a_panic_path_survived() }
}

/// A request to the machine around the board.
fn semihost(operation: u32, argument: u32) {
    // SAFETY: the debugger's breakpoint, which reads what the argument says and changes `r0`.
    unsafe {
        asm!("bkpt 0xAB", inout("r0") operation => _, in("r1") argument, options(nostack));
    }
}

const WRITE: u32 = 0x04;
const EXIT: u32 = 0x18;
const WELL: u32 = 0x20026;

/// Writes eight hexadecimal digits and what follows them.
fn write(bits: u32, then: u8) {
    let mut text = [0_u8; 10];
    let mut rest = bits;
    for place in text.iter_mut().take(8) {
        let digit = (rest >> 28) as u8;
        *place = if digit < 10 { b'0' + digit } else { b'a' - 10 + digit };
        rest <<= 4;
    }
    if let Some(place) = text.get_mut(8) {
        *place = then;
    }
    semihost(WRITE, black_box(&text).as_ptr() as u32);
}

/// SysTick's registers: control, reload value, current value.
const CONTROL: *mut u32 = 0xE000_E010 as *mut u32;
const RELOAD: *mut u32 = 0xE000_E014 as *mut u32;
const CURRENT: *mut u32 = 0xE000_E018 as *mut u32;
const LARGEST: u32 = 0xFF_FFFF;

/// SysTick, which counts down.
#[inline(always)]
fn now() -> u32 {
    // SAFETY: a register of this processor.
    unsafe { CURRENT.read_volatile() }
}

/// The step that is counted.
#[inline(never)]
fn step<R: Run<f32>>(run: &mut R, refused: &mut u32, sample: R::Sample) {
    if !run.step(sample) {
        *refused = refused.wrapping_add(1);
    }
}

/// What is counted with it: a call that returns at once.
#[inline(never)]
fn nothing<R: Run<f32>>(run: &mut R, refused: &mut u32, sample: R::Sample) {
    black_box((&run, &refused));
    let _ = sample;
    // SAFETY: no instruction.
    unsafe { asm!("", options(nostack)) }
}

/// Takes a filter through its samples and writes a line for each: the bits of what it says, ticks for the step, ticks
/// for a call. Then the number of steps that were refused.
pub fn run<R: Run<f32>>() -> ! {
    // SAFETY: registers of this processor: SysTick on, with the processor's clock, without interrupt.
    unsafe {
        RELOAD.write_volatile(LARGEST);
        CURRENT.write_volatile(0);
        CONTROL.write_volatile(0b101);
    }
    let mut refused = 0;
    if let Some(mut filter) = R::begin() {
        for k in 1..=R::STEPS {
            let sample = black_box(R::sample(k));
            let before = now();
            step(&mut filter, &mut refused, sample);
            let between = now();
            nothing(&mut filter, &mut refused, sample);
            let after = now();
            for said in filter.says() {
                write(said.to_bits(), b' ');
            }
            write(before.wrapping_sub(between) & LARGEST, b' ');
            write(between.wrapping_sub(after) & LARGEST, b'\n');
        }
    }
    write(refused, b'\n');
    semihost(EXIT, WELL);
    loop {}
}
