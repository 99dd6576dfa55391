//! Launches: kernels, images, points, clears, uniforms, time, and mistakes in shaders.

#![allow(clippy::unwrap_used, clippy::single_range_in_vec_init, reason = "a test that panics has failed")]

mod common;

use std::collections::HashMap;

use common::{Draft, UNPACK, executor, executors, floats, grey, once, run, uints, with};
use pipe_gpu::{GpuError, RunOptions};
use pipe_graph::types::{ImageType, Precision, VolumeType};
use pipe_plan::plan::{Binding, Launch, Storage};

#[test]
fn a_kernel_fills_a_table_with_its_uniform() {
    let mut d = Draft::new("fill");
    let kernel = d.kernel(
        "struct P { value: f32 } @group(0) @binding(0) var<uniform> p: P;
         @group(0) @binding(1) var<storage, read_write> out: array<f32>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) { out[id.x] = p.value; }",
        &[Binding::Uniform { bytes: 16 }, Binding::WriteBuffer],
    );
    let table = d.words(128);
    d.uniform(&[0; 16]);
    let mut block = [0; 16];
    block[..4].copy_from_slice(&2.5_f32.to_le_bytes());
    let offset = d.uniform(&block);
    assert_eq!(offset, 256);
    d.0.steps.push(with(run("fill", kernel, &[table], [2, 1, 1]), |r| r.uniform_offset = offset));
    d.fetch("out", &[(table, 0..512)]);
    let plan = d.done();
    for mut e in executors() {
        assert_eq!(floats(&once(&mut e, plan.clone(), &[]).fetched["out"]), vec![2.5; 128]);
    }
}

#[test]
fn new_uniforms_and_literals_need_no_new_preparation() {
    let draft = |value: f32, literal: u32| {
        let mut d = Draft::new("update");
        let kernel = d.kernel(
            "@group(0) @binding(0) var<uniform> p: vec4f;
             @group(0) @binding(1) var<storage, read> table: array<u32>;
             @group(0) @binding(2) var<storage, read_write> out: array<f32>;
             @compute @workgroup_size(1) fn main() { out[0] = p.x + f32(table[0]); }",
            &[Binding::Uniform { bytes: 16 }, Binding::ReadBuffer, Binding::WriteBuffer],
        );
        let (table, out) = (d.words(4), d.words(4));
        d.uniform(&[value, 0.0, 0.0, 0.0].map(f32::to_le_bytes).concat());
        d.0.literals.push((table, literal.to_le_bytes().as_slice().into()));
        d.0.slots[0].uploaded = true;
        d.run(kernel, &[table, out], [1, 1, 1]);
        d.fetch("out", &[(out, 0..4)]);
        d
    };
    for mut e in executors() {
        let mut prepared = e.prepare(draft(1.5, 10).done()).unwrap();
        let options = RunOptions::default();
        assert_eq!(floats(&e.run(&prepared, &HashMap::new(), &options).unwrap().fetched["out"]), [11.5]);
        assert!(e.update(&mut prepared, &draft(2.5, 20).done()).unwrap());
        assert_eq!(floats(&e.run(&prepared, &HashMap::new(), &options).unwrap().fetched["out"]), [22.5]);
        let mut other = draft(3.5, 30);
        other.run(pipe_plan::plan::KernelId(0), &[pipe_plan::plan::SlotId(0), pipe_plan::plan::SlotId(1)], [1, 1, 1]);
        assert!(!e.update(&mut prepared, &other.done()).unwrap(), "a plan with another step is another plan");
        assert_eq!(floats(&e.run(&prepared, &HashMap::new(), &options).unwrap().fetched["out"]), [22.5]);
    }
}

/// Writes x + 100·y into images of a format, copies them, and reads them back.
fn through(image: ImageType, format: &str) -> Vec<f32> {
    let mut d = Draft::new("copy");
    let fill = d.kernel(
        &format!(
            "@group(0) @binding(0) var o: texture_storage_2d<{format}, write>;
             @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 if all(id.xy < textureDimensions(o)) {{ textureStore(o, id.xy, vec4f(f32(id.x + 100u * id.y))); }}
             }}"
        ),
        &[Binding::StorageImage(image)],
    );
    let copy = d.kernel(
        &format!(
            "@group(0) @binding(0) var a: texture_2d<f32>;
             @group(0) @binding(1) var o: texture_storage_2d<{format}, write>;
             @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 if all(id.xy < textureDimensions(o)) {{ textureStore(o, id.xy, textureLoad(a, id.xy, 0)); }}
             }}"
        ),
        &[Binding::SampledImage, Binding::StorageImage(image)],
    );
    let unpack = d.kernel(UNPACK, &[Binding::SampledImage, Binding::WriteBuffer]);
    let [w, h] = image.size;
    let (a, b, out) = (d.image(image), d.image(image), d.words(u64::from(w * h)));
    let groups = [w.div_ceil(8), h.div_ceil(8), 1];
    d.run(fill, &[a], groups);
    d.run(copy, &[a, b], groups);
    d.run(unpack, &[b, out], groups);
    d.fetch("out", &[(out, 0..u64::from(w * h) * 4)]);
    floats(&once(&mut executor(), d.done(), &[]).fetched["out"])
}

#[test]
fn images_of_every_format_keep_what_is_stored() {
    let half = executor().device().limits().half_storage;
    let expected: Vec<f32> = (0..9 * 7).map(|i| (i % 9 + 100 * (i / 9)) as f32).collect();
    let formats = [(1, "r32float", "r16float"), (2, "rg32float", "rg16float"), (4, "rgba32float", "rgba16float")];
    for (channels, float, narrow) in formats {
        let image = |precision| ImageType { size: [9, 7], channels, precision };
        assert_eq!(through(image(Precision::F32), float), expected, "{float}");
        if half || channels == 4 {
            assert_eq!(through(image(Precision::F16), narrow), expected, "{narrow}");
        }
    }
}

#[test]
fn volumes_are_textures_of_three_dimensions() {
    let volume = VolumeType { size: [4, 3, 2], channels: 1, precision: Precision::F32 };
    let mut d = Draft::new("volume");
    let fill = d.kernel(
        "@group(0) @binding(0) var o: texture_storage_3d<r32float, write>;
         @compute @workgroup_size(4, 4, 4) fn main(@builtin(global_invocation_id) id: vec3u) {
             if all(id < textureDimensions(o)) { textureStore(o, id, vec4f(f32(id.x + 10u * id.y + 100u * id.z))); }
         }",
        &[Binding::StorageVolume(volume)],
    );
    let read = d.kernel(
        "@group(0) @binding(0) var a: texture_3d<f32>;
         @group(0) @binding(1) var<storage, read_write> o: array<f32>;
         @compute @workgroup_size(4, 4, 4) fn main(@builtin(global_invocation_id) id: vec3u) {
             if all(id < textureDimensions(a)) { o[id.x + 4u * (id.y + 3u * id.z)] = textureLoad(a, id, 0).x; }
         }",
        &[Binding::SampledVolume, Binding::WriteBuffer],
    );
    let (v, out) = (d.slot(Storage::Volume(volume)), d.words(24));
    d.run(fill, &[v], [1, 1, 1]);
    d.run(read, &[v, out], [1, 1, 1]);
    d.fetch("out", &[(out, 0..96)]);
    let expected: Vec<f32> = (0..24).map(|i| (i % 4 + 10 * (i / 4 % 3) + 100 * (i / 12)) as f32).collect();
    assert_eq!(floats(&once(&mut executor(), d.done(), &[]).fetched["out"]), expected);
}

const POINTS: &str = "
@group(0) @binding(0) var<storage, read> weight: array<f32>;
@vertex fn vertex_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    // Points go round the four pixels of a 2x2 image.
    let p = vec2f(f32(i % 2u), f32((i / 2u) % 2u));
    return vec4f((p.x + 0.5) - 1.0, 1.0 - (p.y + 0.5), 0.0, 1.0);
}
@fragment fn fragment_main() -> @location(0) vec4f { return vec4f(weight[0]); }";

#[test]
fn points_add_up_in_a_cleared_image() {
    let mut e = executor();
    let target = grey([2, 2]);
    let mut d = Draft::new("points");
    let splat = d.kernel_as(POINTS, &[Binding::ReadBuffer], Launch::Points(target), true);
    let unpack = d.kernel(UNPACK, &[Binding::SampledImage, Binding::WriteBuffer]);
    let (weight, image, out) = (d.words(4), d.image(target), d.words(4));
    d.upload("weight", weight, &[0..4]);
    d.0.steps.push(with(run("splat", splat, &[weight, image], [4001, 1, 1]), |r| r.clears.push(image)));
    d.run(unpack, &[image, out], [1, 1, 1]);
    d.fetch("out", &[(out, 0..16)]);
    let plan = d.done();
    if !e.device().has_float_blending() {
        assert!(matches!(e.prepare(plan), Err(GpuError::Unsupported { .. })));
        return;
    }
    let prepared = e.prepare(plan).unwrap();
    let weight = 0.5_f32.to_le_bytes();
    let inputs = HashMap::from([("weight", weight.as_slice())]);
    for _ in 0..2 {
        let out = e.run(&prepared, &inputs, &RunOptions::default()).unwrap();
        assert_eq!(floats(&out.fetched["out"]), [500.5, 500.0, 500.0, 500.0], "each run starts from zeros");
    }
}

#[test]
fn clears_come_before_the_launch() {
    let mut d = Draft::new("clears");
    let count = d.kernel(
        "@group(0) @binding(0) var<storage, read_write> n: array<atomic<u32>>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) { atomicAdd(&n[id.x % 4u], 1u); }",
        &[Binding::WriteBuffer],
    );
    let unpack = d.kernel(UNPACK, &[Binding::SampledImage, Binding::WriteBuffer]);
    let fill = d.kernel(
        "@group(0) @binding(0) var o: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) { textureStore(o, id.xy, vec4f(7.0)); }",
        &[Binding::StorageImage(grey([2, 1]))],
    );
    let (table, image, out) = (d.words(4), d.image(grey([2, 1])), d.words(4));
    // Twice: without the second clear the counts would be double.
    for _ in 0..2 {
        d.0.steps.push(with(run("count", count, &[table], [16, 1, 1]), |r| r.clears.push(table)));
    }
    d.run(fill, &[image], [2, 1, 1]);
    d.0.steps.push(with(run("unpack", unpack, &[image, out], [1, 1, 1]), |r| r.clears.push(image)));
    d.fetch("counts", &[(table, 0..16)]);
    d.fetch("image", &[(out, 0..8)]);
    let out = once(&mut executor(), d.done(), &[]);
    assert_eq!(uints(&out.fetched["counts"]), [256; 4]);
    assert_eq!(floats(&out.fetched["image"]), [0.0; 2]);
}

#[test]
fn profiling_gives_each_pass_its_time() {
    let mut d = Draft::new("profile");
    let work = d.kernel(
        "@group(0) @binding(0) var<storage, read_write> o: array<u32>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
             var x = id.x;
             for (var i = 0u; i < 500u; i++) { x = x * 1664525u + 1013904223u; }
             o[id.x] = x;
         }",
        &[Binding::WriteBuffer],
    );
    let table = d.words(1 << 16);
    // More launches than a query set holds.
    for i in 0..300 {
        d.0.steps.push(run(if i % 3 == 0 { "third" } else { "rest" }, work, &[table], [1024, 1, 1]));
    }
    let plan = d.done();
    let mut e = executor();
    let prepared = e.prepare(plan).unwrap();
    let timings = e.run(&prepared, &HashMap::new(), &RunOptions { profile: true, ..RunOptions::default() }).unwrap().timings;
    let names: Vec<&str> = timings.passes.keys().map(String::as_str).collect();
    assert_eq!(names, ["third", "rest"]);
    let (third, rest) = (timings.passes["third"], timings.passes["rest"]);
    assert!(third > 0.0 && rest > third, "{third} {rest}");
    assert!(third + rest <= timings.compute_ms * 1.01, "{third} + {rest} in {}", timings.compute_ms);
    let plain = e.run(&prepared, &HashMap::new(), &RunOptions::default()).unwrap().timings;
    assert!(plain.passes.is_empty());
}

#[test]
fn a_mistake_in_a_shader_names_the_pass_and_the_place() {
    let mut d = Draft::new("mistake");
    let kernel = d.kernel_as(
        "@group(0) @binding(0) var<storage, read_write> o: array<u32>;
@compute @workgroup_size(1) fn main() { o[0] = lumminance(1.0); }",
        &[Binding::WriteBuffer],
        Launch::Compute,
        false,
    );
    let table = d.words(4);
    d.0.steps.push(run("glow", kernel, &[table], [1, 1, 1]));
    let mut e = executor();
    let Err(error) = e.prepare(d.done()) else { panic!("it compiled") };
    let GpuError::Shader { node, label, message } = &error else { panic!("{error}") };
    assert_eq!((node.as_str(), label.as_str()), ("glow", "kernel 0"));
    assert!(message.contains("lumminance") && message.contains("2:"), "{message}");
    // The device is as good as before.
    a_small_plan_runs(&mut e);
}

#[test]
fn a_kernel_that_disagrees_with_its_plan_is_refused() {
    let mut d = Draft::new("disagree");
    let kernel = d.kernel(
        "@group(0) @binding(0) var<storage, read_write> o: array<u32>;
         @compute @workgroup_size(1) fn main() { o[0] = 1u; }",
        &[Binding::ReadBuffer],
    );
    let table = d.words(4);
    d.0.steps.push(run("odd", kernel, &[table], [1, 1, 1]));
    assert!(matches!(executor().prepare(d.done()), Err(GpuError::Shader { node, .. }) if node == "odd"));
}

#[test]
fn deep_expressions_of_users_do_not_overflow_the_stack() {
    let terms = vec!["x"; 20_000].join(" + ");
    let mut d = Draft::new("deep");
    let kernel = d.kernel_as(
        &format!(
            "@group(0) @binding(0) var<storage, read_write> o: array<u32>;
             @compute @workgroup_size(1) fn main() {{ let x = o[1] + 1u; o[0] = {terms}; }}"
        ),
        &[Binding::WriteBuffer],
        Launch::Compute,
        false,
    );
    let table = d.words(4);
    d.0.steps.push(with(run("deep", kernel, &[table], [1, 1, 1]), |r| r.clears.push(table)));
    d.fetch("out", &[(table, 0..4)]);
    assert_eq!(uints(&once(&mut executor(), d.done(), &[]).fetched["out"]), [20_000]);
}

fn a_small_plan_runs(e: &mut pipe_gpu::Executor) {
    let mut d = Draft::new("small");
    let kernel = d.kernel(
        "@group(0) @binding(0) var<storage, read_write> o: array<u32>;
         @compute @workgroup_size(1) fn main() { o[0] = 42u; }",
        &[Binding::WriteBuffer],
    );
    let table = d.words(4);
    d.run(kernel, &[table], [1, 1, 1]);
    d.fetch("out", &[(table, 0..4)]);
    assert_eq!(uints(&once(e, d.done(), &[]).fetched["out"]), [42]);
}
