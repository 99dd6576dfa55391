//! Iteration and simulation.

mod accumulate;
mod energy;
mod heat_diffusion;
mod implicit;
mod jacobi;
mod life;
mod reaction_diffusion;
mod stability;
pub(crate) mod state;
mod wave;
mod wave_equation;
mod wave_step;
mod wave_twin;

use pipe_graph::node::Kind;

/// The kinds of this section, in the order of the reference.
pub(crate) const KINDS: &[Kind] =
    &[wave_equation::KIND, wave_step::KIND, heat_diffusion::KIND, reaction_diffusion::KIND, life::KIND, jacobi::KIND, accumulate::KIND];
