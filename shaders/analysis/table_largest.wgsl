// The largest entry of a table of u32: 4096 entries a workgroup.

var<workgroup> largest: atomic<u32>;

@compute @workgroup_size(256, 1, 1)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        atomicStore(&largest, 0u);
    }
    workgroupBarrier();
    var own = 0u;
    for (var k = 0u; k < 16u; k++) {
        own = max(own, load_table(i32(group.x * 4096u + k * 256u + lane)));
    }
    atomicMax(&largest, own);
    workgroupBarrier();
    if lane == 0u {
        max_out(0, atomicLoad(&largest));
    }
}
