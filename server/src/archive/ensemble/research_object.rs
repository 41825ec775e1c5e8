//! `ro-crate-metadata.json`: an ensemble as an RO-Crate 1.1 that follows the profile Process Run Crate 0.5, so
//! that people and programs without melange know what it is, who made it, and by which code.

use super::super::schema::Kind;
use super::describe::{columns, meaning};
use super::manifest::{FileEntry, MANIFEST, Manifest, SPEC};
use crate::domain::citation::paper;
use crate::domain::seal::{Author, ORCID_ADDRESS, licence};
use serde_json::{Value, json};

/// Name of the metadata in its folder.
pub const METADATA: &str = "ro-crate-metadata.json";
/// The code, of which a version ran.
const CODE: &str = "https://doi.org/10.5194/tc-19-19-2025";
const PROFILE: &str = "https://w3id.org/ro/wfrun/process/0.5";
const PARQUET: &str = "application/vnd.apache.parquet";

/// Where the paper's authors work: name, address, and who.
const UNIVERSITIES: [(&str, &str, &[&str]); 3] = [
    ("University of Alaska Southeast", "https://uas.alaska.edu/", &["Amundson"]),
    ("Georgia Institute of Technology", "https://www.gatech.edu/", &["Robel"]),
    ("Emory University", "https://www.emory.edu/", &["Burton", "Nissanka"]),
];

fn university(family: &str) -> Option<&'static str> {
    UNIVERSITIES.iter().find(|(_, _, who)| who.contains(&family)).map(|(_, url, _)| *url)
}

/// A time with its offset, as the profile wants it.
fn with_offset(time: &str) -> String {
    time.strip_suffix('Z').map_or_else(|| time.to_owned(), |time| format!("{time}+00:00"))
}

/// A file beside those of the manifest: name, media type and what it is.
pub type Beside<'a> = (&'a str, &'a str, &'a str);

/// The metadata of an ensemble; `beside` are the files that follow from those of the manifest.
pub fn metadata(manifest: &Manifest, beside: &[Beside<'_>]) -> Value {
    let tables: Vec<(&FileEntry, Kind)> =
        manifest.files.iter().filter_map(|f| Some((f, f.table()?))).collect();
    let mut graph = vec![descriptor(), root(manifest, &tables, beside)];
    graph.extend(manifest.files.iter().map(file));
    graph.extend(beside.iter().map(|(name, media_type, what)| {
        json!({ "@id": name, "@type": "File", "name": what, "encodingFormat": media_type })
    }));
    graph.extend(action(manifest, &tables));
    graph.extend(people(manifest));
    graph.push(json!({
        "@id": CODE, "@type": "ScholarlyArticle", "name": paper::TITLE,
        "author": paper::AUTHORS.map(|(_, family)| json!({ "@id": format!("#paper-{family}") })),
        "datePublished": paper::YEAR.to_string(),
        "isPartOf": { "@id": "#the-cryosphere" },
        "pagination": format!("{}-{}", paper::PAGES.0, paper::PAGES.1),
        "identifier": format!("https://doi.org/{}", paper::DOI),
    }));
    graph.push(json!({ "@id": "#the-cryosphere", "@type": "Periodical", "name": paper::JOURNAL }));
    graph.extend(paper::AUTHORS.map(|(given, family)| {
        json!({
            "@id": format!("#paper-{family}"), "@type": "Person",
            "name": format!("{given} {family}"), "givenName": given, "familyName": family,
            "affiliation": { "@id": university(family) },
        })
    }));
    graph.extend(UNIVERSITIES.map(
        |(name, url, _)| json!({ "@id": url, "@type": "Organization", "name": name, "url": url }),
    ));
    graph.push(json!({
        "@id": PROFILE, "@type": "CreativeWork", "name": "Process Run Crate", "version": "0.5",
    }));
    if let Some(licence) = manifest.seal.as_ref().and_then(|s| licence(&s.form.licence)) {
        graph.push(json!({
            "@id": licence.url, "@type": "CreativeWork", "name": licence.name, "identifier": licence.id,
            "description": format!("{} (SPDX: {})", licence.name, licence.id),
        }));
    }
    graph.extend(variables(&tables));
    json!({ "@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph })
}

fn descriptor() -> Value {
    json!({
        "@id": METADATA, "@type": "CreativeWork",
        "conformsTo": { "@id": "https://w3id.org/ro/crate/1.1" },
        "about": { "@id": "./" },
    })
}

fn root(manifest: &Manifest, tables: &[(&FileEntry, Kind)], beside: &[Beside<'_>]) -> Value {
    let ids = |ids: Vec<String>| -> Vec<Value> {
        ids.into_iter().map(|id| json!({ "@id": id })).collect()
    };
    let mut parts: Vec<String> = manifest.files.iter().map(|f| f.path.clone()).collect();
    parts.extend(beside.iter().map(|(name, _, _)| (*name).to_owned()));
    let sweep = &manifest.sweep;
    let about = format!(
        "{} runs of the quasi-one-dimensional ice mélange model of Amundson et al. (2025)",
        sweep.counts.total
    );
    let mut root = json!({
        "@id": "./", "@type": "Dataset",
        "conformsTo": { "@id": PROFILE },
        "name": sweep.name,
        "description": about,
        "identifier": format!("blake3:{}", manifest.content_hash),
        "dateCreated": sweep.created_at,
        "datePublished": sweep.created_at.get(..10),
        "hasPart": ids(parts),
        "citation": { "@id": CODE },
        "mentions": { "@id": "#computation" },
        "variableMeasured": ids(tables.iter().flat_map(|(_, kind)| variable_ids(*kind)).collect()),
        "license": "not licensed: this ensemble is not sealed, and its authors have not said how it may be used",
    });
    if let Some(seal) = &manifest.seal {
        root["name"] = seal.form.title.as_str().into();
        if let Some(description) = &seal.form.description {
            root["description"] = description.as_str().into();
        }
        root["datePublished"] = seal.day().into();
        let authors = seal.form.authors.iter().map(|a| json!({ "@id": person_id(a) }));
        root["author"] = one_or_many(authors.collect());
        if let Some(licence) = licence(&seal.form.licence) {
            root["license"] = json!({ "@id": licence.url });
        }
    }
    root
}

/// A list, or what is alone in it: JSON-LD has no lists of one.
fn one_or_many(mut values: Vec<Value>) -> Value {
    if values.len() == 1 { values.remove(0) } else { values.into() }
}

fn file(entry: &FileEntry) -> Value {
    let (name, format) = match entry.table() {
        Some(kind) => (meaning(kind), PARQUET),
        None if entry.path == SPEC => ("what was solved", "application/json"),
        None => ("a file", "application/octet-stream"),
    };
    let mut file = json!({
        "@id": entry.path, "@type": "File", "name": name, "encodingFormat": format,
        "contentSize": entry.bytes.to_string(), "sha256": entry.sha256,
    });
    if let Some(kind) = entry.table() {
        file["variableMeasured"] =
            variable_ids(kind).into_iter().map(|id| json!({ "@id": id })).collect();
    }
    file
}

/// What made the tables: the code, from what was solved.
fn action(manifest: &Manifest, tables: &[(&FileEntry, Kind)]) -> [Value; 2] {
    let version = manifest.seal.as_ref().map(|seal| seal.melange_version.as_str());
    let version = version.unwrap_or(env!("CARGO_PKG_VERSION"));
    let model = manifest.model_version.as_deref().unwrap_or("an older model version");
    let agent = manifest.seal.as_ref().and_then(|seal| seal.form.authors.first());
    let results: Vec<Value> = tables.iter().map(|(f, _)| json!({ "@id": f.path })).collect();
    let mut action = json!({
        "@id": "#computation", "@type": "CreateAction",
        "name": format!("melange solved the runs of the sweep {}", manifest.sweep.id),
        "description": "Every run is identified by model version, options and parameters, and solved once.",
        "instrument": { "@id": code_id(version) },
        "object": { "@id": SPEC },
        "result": one_or_many(results),
        "startTime": with_offset(&manifest.sweep.created_at),
        "actionStatus": "http://schema.org/CompletedActionStatus",
    });
    if let Some(seal) = &manifest.seal {
        action["endTime"] = with_offset(&seal.sealed_at).into();
    }
    if let Some(author) = agent {
        action["agent"] = json!({ "@id": person_id(author) });
    }
    let code = json!({
        "@id": code_id(version), "@type": "SoftwareApplication", "name": "melange",
        "softwareVersion": version,
        "description": format!("ensemble service for ice mélange; numbers of `{model}`"),
        "url": "https://doi.org/10.5194/tc-19-19-2025",
        "citation": { "@id": CODE },
    });
    [action, code]
}

/// The code by its version, as a package URL.
fn code_id(version: &str) -> String {
    format!("pkg:generic/melange@{version}")
}

/// Persons by their ORCID, others by their name; organisations of the persons.
fn people(manifest: &Manifest) -> Vec<Value> {
    let authors = manifest.seal.iter().flat_map(|seal| &seal.form.authors);
    let mut entities = Vec::new();
    for author in authors {
        let (kind, name) = match author.organisation() {
            Some(name) => ("Organization", name),
            None => ("Person", author.name.as_str()),
        };
        let mut person = json!({ "@id": person_id(author), "@type": kind, "name": name });
        if let Some(place) = &author.affiliation {
            let id = format!("#organisation-{}", slug(place));
            person["affiliation"] = json!({ "@id": id });
            let known = entities.iter().any(|e: &Value| e["@id"] == id.as_str());
            if !known {
                entities.push(json!({ "@id": id, "@type": "Organization", "name": place }));
            }
        }
        entities.push(person);
    }
    entities
}

fn person_id(author: &Author) -> String {
    match &author.orcid {
        Some(orcid) => format!("{ORCID_ADDRESS}{orcid}"),
        None => format!("#person-{}", slug(&author.name)),
    }
}

/// A text as part of an id: what is no ASCII letter or digit is told by its code.
fn slug(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            c if c.is_ascii_alphanumeric() => c.to_string(),
            ' ' => "-".to_owned(),
            c => format!("_{:x}", u32::from(c)),
        })
        .collect()
}

fn variable_ids(kind: Kind) -> Vec<String> {
    columns(kind).into_iter().map(|c| format!("#{}-{}", kind.name(), c.name)).collect()
}

/// The column dictionary.
fn variables(tables: &[(&FileEntry, Kind)]) -> Vec<Value> {
    let of_table = |(_, kind): &(&FileEntry, Kind)| {
        let kind = *kind;
        columns(kind).into_iter().map(move |column| {
            json!({
                "@id": format!("#{}-{}", kind.name(), column.name), "@type": "PropertyValue",
                "name": column.name, "unitText": column.unit, "description": column.meaning,
            })
        })
    };
    tables.iter().flat_map(of_table).collect()
}

/// Files that every exported folder has beside those of its manifest.
pub const ALWAYS_BESIDE: [Beside<'static>; 3] = [
    (MANIFEST, "application/json", "files of the ensemble with their hashes"),
    ("README.md", "text/markdown", "how to read the ensemble"),
    ("checksums.sha256", "text/plain", "SHA-256 of every file, for sha256sum -c"),
];
