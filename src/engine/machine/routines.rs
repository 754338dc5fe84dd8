//! The functions that machine code calls: those of the interpreter, on one register in memory.

use crate::engine::functions::{function, function2};
use crate::graph::{Function, Function2};
use crate::wide::{Task, Wide, Width, run};

/// The function's number, where its argument stands, where its value goes.
pub(super) type Unary = unsafe extern "sysv64" fn(usize, *const f64, *mut f64);
/// The function's number, where its arguments stand, where its value goes.
pub(super) type Binary = unsafe extern "sysv64" fn(usize, *const f64, *const f64, *mut f64);

/// The routines of a width that machine code is written for.
pub(super) fn routines(width: Width) -> Option<(Unary, Binary)> {
    if Some(width) == Width::avx512() {
        Some((unary::<0>, binary::<0>))
    } else if Some(width) == Width::avx2() {
        Some((unary::<1>, binary::<1>))
    } else if width == Width::single() && Width::avx2().is_some() {
        Some((unary::<2>, binary::<2>))
    } else {
        None
    }
}

/// The width that routine `W` is made for; machine code of it exists only where the processor has it.
fn width<const W: usize>() -> Width {
    match W {
        0 => Width::avx512().unwrap_or_else(Width::portable),
        1 => Width::avx2().unwrap_or_else(Width::portable),
        _ => Width::single(),
    }
}

/// # Safety
/// Both addresses must be those of a register of this width.
unsafe extern "sysv64" fn unary<const W: usize>(number: usize, a: *const f64, to: *mut f64) {
    run(width::<W>(), One { of: Function::ALL[number % Function::ALL.len()], a, to });
}

/// # Safety
/// All addresses must be those of a register of this width.
unsafe extern "sysv64" fn binary<const W: usize>(number: usize, a: *const f64, b: *const f64, to: *mut f64) {
    run(width::<W>(), Two { of: Function2::ALL[number % Function2::ALL.len()], a, b, to });
}

struct One {
    of: Function,
    a: *const f64,
    to: *mut f64,
}

impl Task for One {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        // SAFETY: the caller of the routine says that both are registers.
        unsafe { function(self.of, W::read(self.a)).write(self.to) }
    }
}

struct Two {
    of: Function2,
    a: *const f64,
    b: *const f64,
    to: *mut f64,
}

impl Task for Two {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        // SAFETY: the caller of the routine says that all are registers.
        unsafe { function2(self.of, W::read(self.a), W::read(self.b)).write(self.to) }
    }
}
