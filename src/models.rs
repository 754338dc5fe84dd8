//! Models that ship beside the motors of [`pmsm`](crate::pmsm): a linear axis on its own and under its controller.
//!
//! | model | equations | for |
//! |---|---|---|
//! | [`Positioning`] | mass, viscous and dry friction, offset | the drive's command in; position measured |
//! | [`PositioningLoop`] | the same under a position and speed controller | the reference in; position and command measured |
//!
//! They are plain [`Model`](crate::Model)s: what is written here is what a user would write.

mod positioning;

pub use positioning::{
    AxisMotion, AxisParameters, Command, ControlledAxisMotion, ControlledAxisOutput, Position, Positioning,
    PositioningLoop, Reference,
};
