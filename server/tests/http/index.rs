//! The list: described, and as described.

use lodestream_preprocess::preview::PREVIEW_SIZE;
use serde_json::{Value, json};

use crate::support::{Site, dataset, field};

/// The schema of a document's component, with the document's other components within reach.
fn schema_of(document: &Value, component: &str) -> jsonschema::Validator {
    let mut schema = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$ref": format!("#/components/schemas/{component}"),
    });
    schema["components"] = document["components"].clone();
    jsonschema::validator_for(&schema).expect("a schema")
}

fn told(validator: &jsonschema::Validator, value: &Value) -> Vec<String> {
    validator.iter_errors(value).map(|error| error.to_string()).collect()
}

#[tokio::test]
async fn the_description_is_openapi() {
    let site = Site::new();
    let document = site.json("/openapi.json").await;
    let schema: Value =
        serde_json::from_str(include_str!("../openapi-3.1.json")).expect("the schema is JSON");
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    assert_eq!(told(&validator, &document), [""; 0]);
    assert!(!validator.is_valid(&json!({ "openapi": "3.1.0", "info": {} })), "it can refuse");
    assert_eq!(document["openapi"].as_str().map(|v| &v[..3]), Some("3.1"));
    let paths: Vec<_> = document["paths"].as_object().expect("paths").keys().collect();
    assert_eq!(paths.len(), 7, "{paths:?}");
}

#[tokio::test]
async fn the_list_is_as_described() {
    let (site, _) = Site::with_dataset();
    site.put("garbage.lods", b"garbage");
    let document = site.json("/openapi.json").await;
    let validator = schema_of(&document, "DatasetIndex");
    let list = site.json("/datasets").await;
    assert_eq!(list["unreadable"].as_array().map(Vec::len), Some(1));
    assert_eq!(told(&validator, &list), [""; 0]);
    let mut wrong = list.clone();
    wrong["datasets"][0]["points"] = json!("many");
    assert!(!validator.is_valid(&wrong), "it can refuse");
    wrong = list;
    wrong["datasets"][0].as_object_mut().expect("an entry").remove("content_id");
    assert!(!validator.is_valid(&wrong), "it can refuse");
}

/// A dataset with points, as a build makes it.
fn build(folder: &std::path::Path, seed: u8) -> Vec<u8> {
    use lodestream_server::commands::build::{BuildArgs, run};
    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        build: BuildArgs,
    }
    let output = folder.join("a.lods");
    let input = format!("sim:courtyard?points=20k&seed={seed}");
    let arguments = ["x", &input, "-o", output.to_str().expect("a plain path")];
    // Only a process's first build can be interrupted by a signal; this is one of several here.
    let line = <Line as clap::Parser>::parse_from(arguments);
    std::thread::spawn(move || run(line.build)).join().expect("no panic").expect("built");
    std::fs::read(output).expect("written")
}

#[tokio::test]
async fn a_preview_is_shown_until_its_dataset_is_replaced() {
    let site = Site::new();
    build(site.folder.path(), 1);
    let list = site.json("/datasets").await;
    let url = list["datasets"][0]["preview"].as_str().expect("a preview").to_owned();
    let response = site.get(&format!("/{url}"), &[]).await;
    assert_eq!(response.status(), 200);
    assert_eq!(field(response.headers(), "content-type"), "image/png");
    assert!(field(response.headers(), "cache-control").contains("immutable"));
    let picture = response.bytes().await.expect("a picture");
    let size: Vec<u8> = PREVIEW_SIZE.iter().flat_map(|side| side.to_be_bytes()).collect();
    assert_eq!(picture[16..24], size);
    let page = site.get("/", &[]).await.text().await.expect("a page");
    assert!(page.contains(&url), "{page}");

    site.put("a.lods", &dataset(1, 10));
    assert_eq!(site.json("/datasets").await["datasets"][0]["preview"], Value::Null);
    assert_eq!(site.get(&format!("/{url}"), &[]).await.status(), 404);
    assert_eq!(site.get("/datasets/a.lods/preview.png", &[]).await.status(), 404);
}

#[tokio::test]
async fn the_page_needs_no_scripts_and_lets_none_in() {
    let (site, _) = Site::with_dataset();
    let response = site.get("/", &[("host", "data.example")]).await;
    let policy = field(response.headers(), "content-security-policy").to_owned();
    assert!(policy.starts_with("default-src 'none'") && !policy.contains("script-src"));
    let page = response.text().await.expect("a page");
    assert!(!page.contains("<script"));
    assert!(page.contains("http://data.example/datasets/<wbr>a.lods"), "{page}");
}
