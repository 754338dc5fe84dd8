//! Functions in lanes.
//!
//! The functions that models call most are written on whole registers, to about 1e-15; the others take one lane after the other. Each
//! lane has the bits that it would have alone.

use crate::graph::Function;
use crate::wide::{Task, Wide, Width, run};
use core::f64::consts::{FRAC_2_PI, LOG2_E};

/// A function of the numbers in registers, which are then in others.
///
/// A function of its own, and no part of the interpreter's loop, which would be slower by it.
///
/// # Safety
/// At both addresses there must be so many registers of this width.
#[inline(never)]
pub(super) unsafe fn apply(width: Width, of: Function, a: *const f64, to: *mut f64, registers: usize) {
    run(width, Apply { of, a, to, registers });
}

struct Apply {
    of: Function,
    a: *const f64,
    to: *mut f64,
    registers: usize,
}

impl Task for Apply {
    type Output = ();
    #[inline(always)]
    fn run<W: Wide>(self) {
        for k in 0..self.registers {
            // SAFETY: whoever calls `apply` says that the registers are there.
            unsafe { function(self.of, W::read(self.a.add(k * W::LANES))).write(self.to.add(k * W::LANES)) }
        }
    }
}

/// A function of one number, lane by lane.
#[inline(always)]
fn function<W: Wide>(function: Function, a: W) -> W {
    match function {
        Function::Exp => exp(a),
        Function::Tanh => tanh(a),
        Function::Sin => sin_or_cos::<W, 0>(a),
        Function::Cos => sin_or_cos::<W, 1>(a),
        _ => a.map(|x| function.of(x)),
    }
}

/// The nearest whole number, of what is below 2^51.
#[inline(always)]
fn nearest<W: Wide>(a: W) -> W {
    // Adding 1.5 * 2^52 pushes the fraction out.
    let shift = W::splat(6_755_399_441_055_744.0);
    a.add(shift).sub(shift)
}

/// `c[0] + c[1] x + ...`
#[inline(always)]
fn polynomial<W: Wide, const N: usize>(x: W, c: &[f64; N]) -> W {
    let mut sum = W::splat(c[N - 1]);
    let mut i = N - 1;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(x, W::splat(c[i]));
    }
    sum
}

/// Half of ln 2 to either side by its series; the rest is a power of two (W. J. Cody, W. Waite, *Software Manual for the
/// Elementary Functions*, 1980, chapter 6).
#[inline(always)]
fn exp<W: Wide>(x: W) -> W {
    const SERIES: [f64; 14] = [
        1.0,
        1.0,
        1.0 / 2.0,
        1.0 / 6.0,
        1.0 / 24.0,
        1.0 / 120.0,
        1.0 / 720.0,
        1.0 / 5_040.0,
        1.0 / 40_320.0,
        1.0 / 362_880.0,
        1.0 / 3_628_800.0,
        1.0 / 39_916_800.0,
        1.0 / 479_001_600.0,
        1.0 / 6_227_020_800.0,
    ];
    // Beyond, it is zero or infinite in any case; what is not a number passes.
    let (low, high) = (W::splat(-746.0), W::splat(710.0));
    let x = x.select_lt(low, low, x);
    let x = high.select_lt(x, high, x);
    let n = nearest(x.mul(W::splat(LOG2_E)));
    // ln 2 in two parts, of which the first times `n` is exact.
    let r = n.neg_mul_add(W::splat(6.931_471_803_691_238e-1), x);
    let r = n.neg_mul_add(W::splat(1.908_214_929_270_587_7e-10), r);
    polynomial(r, &SERIES).scale2(n)
}

/// Beyond, the hyperbolic tangent rounds to one: it is below one by less than `2 exp(-40)`, 8.5e-18.
const SATURATED: f64 = 20.0;

/// A quotient of polynomials near zero (S. L. Moshier, Cephes Mathematical Library, 1989), beyond by the exponential.
#[inline(always)]
fn tanh<W: Wide>(x: W) -> W {
    const ABOVE: [f64; 3] = [-1.614_687_684_417_084_6e3, -9.928_772_310_019_185e1, -9.643_991_794_250_523e-1];
    const BELOW: [f64; 4] = [4.844_063_053_251_255e3, 2.235_488_390_601_004_5e3, 1.128_116_784_916_329_3e2, 1.0];
    let (one, size) = (W::splat(1.0), x.abs());
    // Dry friction is saturated at most samples. The exponential would give the same bits.
    if size.neg().all_below(-SATURATED) {
        return one.copysign(x);
    }
    let square = x.mul(x);
    let near = x.mul(square).mul_add(polynomial(square, &ABOVE).div(polynomial(square, &BELOW)), x);
    let far = one.sub(W::splat(2.0).div(exp(size.add(size)).add(one)));
    size.select_lt(W::splat(0.625), near, far).copysign(x)
}

/// Beyond this angles are reduced one by one.
const FAR: f64 = 1e6;

/// Sine (0) or cosine (1): the angle less quarter turns, in three parts of which the first two are exact, then the
/// polynomials of Sun's fdlibm (1993).
#[inline(always)]
fn sin_or_cos<W: Wide, const QUARTERS: u8>(x: W) -> W {
    const SIN: [f64; 6] = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_006_8e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    const COS: [f64; 6] = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    let n = nearest(x.mul(W::splat(FRAC_2_PI)));
    let r = n.neg_mul_add(W::splat(1.570_796_326_734_125_6), x);
    let r = n.neg_mul_add(W::splat(6.077_100_506_303_966e-11), r);
    let r = n.neg_mul_add(W::splat(2.022_266_248_795_950_6e-21), r);
    let (square, one) = (r.mul(r), W::splat(1.0));
    let sin = r.mul(square).mul_add(polynomial(square, &SIN), r);
    let half = square.mul(W::splat(0.5));
    let cos = one.sub(half);
    // The rounding error of the subtraction is added again.
    let rest = one.sub(cos).sub(half);
    let cos = cos.add(square.mul(square).mul_add(polynomial(square, &COS), rest));
    // Quarter turns, from 0 to 3, and what they make of sine and cosine.
    let n = n.add(W::splat(f64::from(QUARTERS)));
    let turns = nearest(n.sub(W::splat(1.5)).mul(W::splat(0.25)));
    let quarter = turns.neg_mul_add(W::splat(4.0), n);
    let odd = quarter.select_eq(one, cos, quarter.select_eq(W::splat(3.0), cos, sin));
    let turned = W::splat(1.5).select_lt(quarter, odd.neg(), odd);
    let turned = if QUARTERS == 0 { x.select_eq(W::splat(0.0), x, turned) } else { turned };
    let size = x.abs();
    if size.all_below(FAR) {
        return turned;
    }
    let exact = if QUARTERS == 0 { x.map(f64::sin) } else { x.map(f64::cos) };
    size.select_lt(W::splat(FAR), turned, exact)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Of<'a>(Function, &'a [f64]);

    impl Task for Of<'_> {
        type Output = Vec<f64>;
        #[inline(always)]
        fn run<W: Wide>(self) -> Vec<f64> {
            let mut values = vec![];
            for x in self.1.chunks_exact(8) {
                for x in x.chunks_exact(W::LANES) {
                    let mut lanes = [0.0; 8];
                    function(self.0, W::load(x)).store(&mut lanes);
                    values.extend(&lanes[..W::LANES]);
                }
            }
            values
        }
    }

    fn arguments() -> Vec<f64> {
        let mut all = vec![0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-310, -5e-324, 1e308];
        all.extend([709.7, 709.79, 710.5, -708.0, -745.0, -745.2, -800.0, 0.625]);
        all.extend([
            -SATURATED,
            19.06,
            19.07,
            SATURATED,
            -20.1,
            20.1,
            21.0,
            f64::NAN,
            20.5,
            30.0,
            -25.0,
            22.0,
            23.0,
            24.0,
            26.0,
            27.0,
        ]);
        all.extend((-40_000..40_000).map(|i| f64::from(i) * 0.00171));
        all.extend((-4_000..4_000).map(|i| f64::from(i) * 0.1713));
        all.extend((-4_000..4_000).map(|i| f64::from(i) * 311.7));
        // Close to multiples of a quarter turn.
        all.extend((-4_000..4_000).map(|i| f64::from(i) * core::f64::consts::FRAC_PI_2));
        all
    }

    #[test]
    fn functions_are_right_to_their_last_digits() {
        let x = arguments();
        // 1e-15 is four and a half units in the last place: rounding of polynomials, of two quotients and of an exponential.
        for function in [Function::Exp, Function::Tanh, Function::Sin, Function::Cos] {
            for (x, found) in x.iter().zip(run(Width::widest(), Of(function, &x))) {
                let expected: f64 = function.of(*x);
                let near = (found - expected).abs() <= 1e-15 * expected.abs() + 5e-324;
                let same = found == expected || found.is_nan() && expected.is_nan();
                assert!(near || same, "{function:?}({x:e}) is {expected:e}, not {found:e}");
                assert!(
                    expected != 0.0 || found.is_sign_negative() == expected.is_sign_negative(),
                    "{function:?}({x:e})"
                );
            }
        }
    }

    #[test]
    fn functions_have_the_same_bits_in_every_width() {
        let x = arguments();
        let bits = |width, function| -> Vec<u64> {
            let values = run(width, Of(function, &x)).into_iter();
            values.map(|x| if x.is_nan() { 0 } else { x.to_bits() }).collect()
        };
        for function in [Function::Exp, Function::Tanh, Function::Sin, Function::Cos, Function::Ln] {
            let expected = bits(Width::portable(), function);
            for width in [Width::avx512(), Width::avx2(), Some(Width::single())].into_iter().flatten() {
                assert_eq!(bits(width, function), expected, "{function:?}, {width:?}");
            }
        }
    }
}
