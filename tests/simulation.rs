//! The wave equation against what is known in closed form.
//!
//! cos(2πkx/N) is an eigenvector of the periodic 5-point Laplacian, with eigenvalue −(2 − 2cos(2πk/N))/dx². So each
//! integrator maps the amplitudes (u, v) of such a standing wave by a 2×2 matrix that its definition gives, and n steps by
//! the n-th power of it: the *discrete* solution, without any error of the discretisation.

use std::f64::consts::TAU;

use pipe_graph::reference::{Raster, Tensor};
use pipe_graph::types::EdgeType;
use pipe_tests::bench::{Bench, compile};

const N: u32 = 32;
const ROWS: u32 = 5;
const C2: f64 = 20.0;
const DX: f64 = 0.01;

type Matrix = [[f64; 2]; 2];

fn times(a: Matrix, b: Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

fn power(m: Matrix, n: u32) -> Matrix {
    (0..n).fold([[1.0, 0.0], [0.0, 1.0]], |p, _| times(p, m))
}

fn inverse([[a, b], [c, d]]: Matrix) -> Matrix {
    let det = a * d - b * c;
    [[d / det, -b / det], [-c / det, a / det]]
}

/// ω² of mode k.
fn omega2(k: u32) -> f64 {
    C2 * (2.0 - 2.0 * (TAU * f64::from(k) / f64::from(N)).cos()) / (DX * DX)
}

/// What one step does to (u, v) of a mode: u' = v, v' = −ω²u.
fn amplification(integrator: &str, h: f64, w2: f64) -> Matrix {
    let theta = |t: f64| times(inverse([[1.0, -t * h], [t * h * w2, 1.0]]), [[1.0, (1.0 - t) * h], [-(1.0 - t) * h * w2, 1.0]]);
    let taylor = [[1.0 - h * h * w2 / 2.0, h], [-h * w2, 1.0 - h * h * w2 / 2.0]];
    match integrator {
        "Euler" => [[1.0, h], [-h * w2, 1.0]],
        "SymplecticEuler" => [[1.0 - h * h * w2, h], [-h * w2, 1.0]],
        "Midpoint" | "RungeKutta2" => taylor,
        "Verlet" => [[taylor[0][0], h], [-h * w2 * (1.0 - h * h * w2 / 4.0), taylor[0][0]]],
        "BackwardEuler" => theta(1.0),
        "CrankNicolson" => theta(0.5),
        other => panic!("{other}"),
    }
}

/// The largest amplitudes of u and v, and the energy, after some steps from cos(2πkx/N) at rest.
fn run(bench: &mut Bench, integrator: &str, k: u32, dt: f64, steps: u32) -> Vec<[f64; 2]> {
    let text = format!(
        r#"Graph(version: 1, inputs: {{"in": Image}}, nodes: {{
            "w": WaveEquation(state: "in", steps: {steps}, dt: {dt:?}, dx: {DX}, c2: {C2}, integrator: {integrator}, boundary: Periodic,
                              tolerance: 1e-9)}}, outputs: {{"out": "w"}})"#
    );
    let graph = compile(&text, &[("in", EdgeType::image([N, ROWS], 2))]).unwrap_or_else(|e| panic!("{e}"));
    let mode = |_: &str| {
        Tensor::Image(Raster::from_fn([N, ROWS], 2, |x, _| [(TAU * f64::from(k) * x as f64 / f64::from(N)).cos(), 0.0, 0.0, 1.0]))
    };
    let got = bench.gpu(&graph, &mode).unwrap_or_else(|e| panic!("{e}"));
    got["out"].chunks(2).map(|c| [c[0], c[1]]).collect()
}

const ALL: [&str; 7] = ["Euler", "SymplecticEuler", "Midpoint", "RungeKutta2", "Verlet", "BackwardEuler", "CrankNicolson"];

#[test]
fn a_standing_wave_is_the_discrete_solution_over_a_thousand_steps() {
    let mut bench = Bench::new();
    let (k, steps) = (2, 1000);
    let w2 = omega2(k);
    for integrator in ALL {
        // A tenth of a radian a step; explicit Euler grows by √(1 + (ωh)²) each step, so less of it.
        let phase = if integrator.ends_with("Euler") && integrator != "SymplecticEuler" { 0.02 } else { 0.1 };
        let h = f64::from((phase / w2.sqrt()) as f32);
        let m = power(amplification(integrator, h, w2), steps);
        let (u, v) = (m[0][0], m[1][0]);
        let size = u.hypot(v / w2.sqrt());
        for (i, [gu, gv]) in run(&mut bench, integrator, k, h, steps).into_iter().enumerate() {
            let shape = (TAU * f64::from(k) * (i % N as usize) as f64 / f64::from(N)).cos();
            let (eu, ev) = ((gu - u * shape).abs() / size, (gv - v * shape).abs() / (size * w2.sqrt()));
            assert!(eu < 1e-3 && ev < 1e-3, "{integrator} at {i}: off by {eu:e}, {ev:e} of the amplitude");
        }
    }
}

#[test]
fn the_orders_of_convergence_are_1_and_2() {
    let mut bench = Bench::new();
    let k = 1;
    let w = omega2(k).sqrt();
    for integrator in ALL {
        let error = |bench: &mut Bench, steps: u32| {
            // A time at which neither u nor v is 0.
            let h = f64::from((1.0 / w / f64::from(steps)) as f32);
            let [u, v] = run(bench, integrator, k, h, steps)[0];
            let t = w * h * f64::from(steps);
            (u - t.cos()).hypot(v / w + t.sin())
        };
        let (coarse, fine) = (error(&mut bench, 10), error(&mut bench, 20));
        let order = (coarse / fine).log2();
        let expected = if integrator.ends_with("Euler") { 1.0 } else { 2.0 };
        assert!((order - expected).abs() < 0.15, "{integrator}: order {order:.3}, expected {expected} (errors {coarse:e}, {fine:e})");
    }
}

#[test]
fn implicit_steps_are_stable_a_hundred_times_beyond_the_explicit_limit() {
    let mut bench = Bench::new();
    // The highest mode along x has ω² = 4c²/dx²; leapfrog is stable up to 2/ω of the highest mode of both axes.
    let h = 100.0 * 2.0 / (8.0 * C2 / (DX * DX)).sqrt();
    for integrator in ["BackwardEuler", "CrankNicolson"] {
        for k in [1, 7, 16] {
            let worst = run(&mut bench, integrator, k, h, 50).into_iter().map(|c| c[0].abs()).fold(0.0, f64::max);
            assert!(worst <= 1.0 + 1e-3, "{integrator}, mode {k}: {worst}");
        }
    }
}

#[test]
fn symplectic_steps_hold_the_energy_over_a_hundred_thousand_steps() {
    let mut bench = Bench::new();
    let k = 3;
    let w2 = omega2(k);
    let h = f64::from((0.2 / w2.sqrt()) as f32);
    for integrator in ["Verlet", "SymplecticEuler"] {
        let energy = |c: &[f64; 2]| c[0] * c[0] + c[1] * c[1] / w2;
        let state = run(&mut bench, integrator, k, h, 100_000);
        let whole: f64 = state.iter().map(energy).sum();
        let start = f64::from(N * ROWS) / 2.0;
        // The conserved quantity differs from the energy by at most ωh/2 of it.
        assert!((whole / start - 1.0).abs() < 0.15, "{integrator}: {} of the energy", whole / start);
    }
}
