//! The functions that machine code calls: those of the interpreter, on one register in memory.

use crate::engine::functions::apply;
use crate::graph::{Function, Function2};
use crate::scalar::Table;
use crate::wide::Width;

/// The function's number, where its argument stands, where its value goes.
pub(super) type Unary = unsafe extern "sysv64" fn(usize, *const f64, *mut f64);
/// The function's number, where its arguments stand, where its value goes.
pub(super) type Binary = unsafe extern "sysv64" fn(usize, *const f64, *const f64, *mut f64);

/// The orders of a derivative, its arguments, where it goes, and the table.
pub(super) type LookUp = unsafe extern "sysv64" fn(usize, *const f64, *const f64, *mut f64, *const Table);

/// The routines of a width that machine code is written for.
pub(super) fn routines(width: Width) -> Option<(Unary, Binary, LookUp)> {
    if Some(width) == Width::avx512() {
        Some((unary::<0>, binary::<8>, look_up::<8>))
    } else if Some(width) == Width::avx2() {
        Some((unary::<1>, binary::<4>, look_up::<4>))
    } else if width == Width::single() && Width::avx2().is_some() {
        Some((unary::<2>, binary::<1>, look_up::<1>))
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
    // SAFETY: as the caller says.
    unsafe { apply(width::<W>(), Function::ALL[number % Function::ALL.len()], a, to, 1) }
}

/// # Safety
/// All addresses must be those of a register of this many lanes.
unsafe extern "sysv64" fn binary<const LANES: usize>(number: usize, a: *const f64, b: *const f64, to: *mut f64) {
    let function = Function2::ALL[number % Function2::ALL.len()];
    // SAFETY: as the caller says; arguments may be where the value goes, hence lane by lane.
    unsafe {
        for lane in 0..LANES {
            let y = *b.add(lane);
            *to.add(lane) = function.of(*a.add(lane), y, Some(y));
        }
    }
}

/// # Safety
/// All addresses must be those of a register of this many lanes, the last that of a table.
unsafe extern "sysv64" fn look_up<const LANES: usize>(
    order: usize,
    x: *const f64,
    y: *const f64,
    to: *mut f64,
    table: *const Table,
) {
    // SAFETY: as the caller says; arguments may be where the value goes, hence lane by lane.
    unsafe {
        let (grid, order) = ((*table).grid(), [(order >> 4) as u8, order as u8 & 15]);
        for lane in 0..LANES {
            *to.add(lane) = grid.derivative([*x.add(lane), *y.add(lane)], order);
        }
    }
}
