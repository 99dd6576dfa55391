//! Generated pages are committed; this finds them stale. `make generated` writes them anew.

#[test]
fn the_node_reference_is_fresh() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/nodes.md");
    let committed = std::fs::read_to_string(path).expect("the page is committed");
    let fresh = pipe_nodes::reference::page(&pipe_nodes::REGISTRY);
    assert!(committed == fresh, "docs/nodes.md is stale: run `make generated`");
}

#[test]
fn every_field_and_port_is_documented() {
    let mut bare = Vec::new();
    for kind in pipe_nodes::REGISTRY.iter() {
        let schema = serde_json::json!((kind.schema)());
        if schema["description"].as_str().unwrap_or_default().is_empty() {
            bare.push(kind.name.to_owned());
        }
        for (field, property) in schema["properties"].as_object().into_iter().flatten() {
            if property["description"].as_str().unwrap_or_default().is_empty() {
                bare.push(format!("{}.{field}", kind.name));
            }
        }
    }
    assert!(bare.is_empty(), "no description: {}", bare.join(", "));
}

#[test]
fn every_preset_checks() {
    for name in pipe::presets::names() {
        let mut project = pipe::project::Project::open(name).unwrap_or_else(|e| panic!("{e}"));
        let graph = project.resolve(&pipe_graph::resolve::Request::default(), &pipe::project::World::default());
        assert!(graph.is_some() && project.diagnostics.is_empty(), "{name}:\n{}", project.render(false));
        assert!(project.document.is_some_and(|d| !d.doc.is_empty()), "{name} has no doc");
    }
}
