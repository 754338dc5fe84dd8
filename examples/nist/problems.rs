//! The 27 problems of nonlinear regression of NIST's Statistical Reference Datasets, as models.

use greybox::{Kind, Model, Nothing, Scalar, signals};
use std::f64::consts::PI;

signals! {
    /// What is varied; all problems but one use `x` alone.
    pub struct Predictors { x: "", x2: "" }
    /// What is measured; of Nelson its logarithm.
    pub struct Response { y: "" }
    /// Two parameters.
    pub struct Two { b1: "", b2: "" }
    /// Three parameters.
    pub struct Three { b1: "", b2: "", b3: "" }
    /// Four parameters.
    pub struct Four { b1: "", b2: "", b3: "", b4: "" }
    /// Five parameters.
    pub struct Five { b1: "", b2: "", b3: "", b4: "", b5: "" }
    /// Six parameters.
    pub struct Six { b1: "", b2: "", b3: "", b4: "", b5: "", b6: "" }
    /// Seven parameters.
    pub struct Seven { b1: "", b2: "", b3: "", b4: "", b5: "", b6: "", b7: "" }
    /// Eight parameters.
    pub struct Eight { b1: "", b2: "", b3: "", b4: "", b5: "", b6: "", b7: "", b8: "" }
    /// Nine parameters.
    pub struct Nine { b1: "", b2: "", b3: "", b4: "", b5: "", b6: "", b7: "", b8: "", b9: "" }
}

/// What is to be done with a problem, whichever it is.
pub trait Task {
    /// What it gives.
    type Answer;
    /// Does it.
    fn run<M: Model<State = Nothing, Input = Predictors, Output = Response> + Clone>(self, model: &M) -> Self::Answer;
}

macro_rules! problems {
    ($($($name:ident)+: $size:ident($($b:ident)*), |$($x:ident)+| $y:expr;)*) => {
        /// Runs a task on the problem of this name; `None` if there is no such problem.
        pub fn by_name<T: Task>(name: &str, task: T) -> Option<T::Answer> {
            match name {
                $($(stringify!($name))|+ => {
                    #[derive(Clone)]
                    struct Problem;
                    impl Model for Problem {
                        type State = Nothing;
                        type Input = Predictors;
                        type Output = Response;
                        type Parameters = $size;
                        const KIND: Kind = Kind::Static;

                        fn output<S: Scalar>(
                            &self, _t: S, _x: &Nothing, u: &Predictors<S>, p: &$size<S>,
                        ) -> Response<S> {
                            let ($($x,)+ $size { $($b),* }) = ($(u.$x,)+ *p);
                            Response { y: $y }
                        }
                    }
                    Some(task.run(&Problem))
                })*
                _ => None,
            }
        }
    };
}

problems! {
    Misra1a BoxBOD: Two(b1 b2), |x| b1 * -(-b2 * x).exp_m1();
    Misra1b: Two(b1 b2), |x| b1 * (-(b2 * x / 2.0 + 1.0).powi(-2) + 1.0);
    Misra1c: Two(b1 b2), |x| b1 * (-(b2 * x * 2.0 + 1.0).powf(-0.5) + 1.0);
    Misra1d: Two(b1 b2), |x| b1 * b2 * x / (b2 * x + 1.0);
    DanWood: Two(b1 b2), |x| b1 * x.pow(b2);
    Chwirut1 Chwirut2: Three(b1 b2 b3), |x| (-b1 * x).exp() / (b2 + b3 * x);
    Nelson: Three(b1 b2 b3), |x x2| b1 - b2 * x * (-b3 * x2).exp();
    MGH10: Three(b1 b2 b3), |x| b1 * (b2 / (x + b3)).exp();
    Rat42: Three(b1 b2 b3), |x| b1 / ((b2 - b3 * x).exp() + 1.0);
    Eckerle4: Three(b1 b2 b3), |x| b1 / b2 * (((x - b3) / b2).powi(2) * -0.5).exp();
    Bennett5: Three(b1 b2 b3), |x| b1 * (b2 + x).pow(-b3.recip());
    Rat43: Four(b1 b2 b3 b4), |x| b1 / ((b2 - b3 * x).exp() + 1.0).pow(b4.recip());
    MGH09: Four(b1 b2 b3 b4), |x| b1 * (x * x + x * b2) / (x * x + x * b3 + b4);
    Roszman1: Four(b1 b2 b3 b4), |x| b1 - b2 * x - (b3 / (x - b4)).atan() / PI;
    MGH17: Five(b1 b2 b3 b4 b5), |x| b1 + b2 * (-x * b4).exp() + b3 * (-x * b5).exp();
    Kirby2: Five(b1 b2 b3 b4 b5), |x| (b1 + x * (b2 + x * b3)) / (x * (b4 + x * b5) + 1.0);
    Lanczos1 Lanczos2 Lanczos3: Six(b1 b2 b3 b4 b5 b6),
        |x| b1 * (-b2 * x).exp() + b3 * (-b4 * x).exp() + b5 * (-b6 * x).exp();
    Hahn1 Thurber: Seven(b1 b2 b3 b4 b5 b6 b7),
        |x| (b1 + x * (b2 + x * (b3 + x * b4))) / (x * (b5 + x * (b6 + x * b7)) + 1.0);
    Gauss1 Gauss2 Gauss3: Eight(b1 b2 b3 b4 b5 b6 b7 b8),
        |x| b1 * (-b2 * x).exp() + b3 * (-((x - b4) / b5).powi(2)).exp() + b6 * (-((x - b7) / b8).powi(2)).exp();
    ENSO: Nine(b1 b2 b3 b4 b5 b6 b7 b8 b9), |x| {
        let (year, short, long) = (x * (2.0 * PI / 12.0), x * (2.0 * PI) / b4, x * (2.0 * PI) / b7);
        b1 + b2 * year.cos() + b3 * year.sin() + b5 * short.cos() + b6 * short.sin() + b8 * long.cos() + b9 * long.sin()
    };
}
