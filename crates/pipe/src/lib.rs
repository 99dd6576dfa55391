//! pipe: a node-graph image pipeline processor on the GPU.
