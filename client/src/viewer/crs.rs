//! What people want to know of a coordinate reference system: its name and its unit of length.

/// Longest name that is shown.
const LONGEST_NAME: usize = 80;

/// Name and unit.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Crs {
    /// As the system calls itself.
    pub name: Option<String>,
    /// Of lengths across: `m`, `ft`, `°`; nothing where it is not known.
    pub unit: Option<&'static str>,
}

impl Crs {
    /// From well-known text, of either version.
    #[must_use]
    pub fn of(wkt: Option<&str>) -> Self {
        let Some(wkt) = wkt else { return Self::default() };
        let name = quoted(wkt).map(|name| name.chars().take(LONGEST_NAME).collect());
        Self { name, unit: unit(wkt) }
    }

    /// The name, for people.
    #[must_use]
    pub fn title(&self) -> &str {
        self.name.as_deref().unwrap_or("no coordinate system given")
    }
}

/// The first text in quotes.
fn quoted(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once('"')?;
    let (inside, _) = rest.split_once('"')?;
    Some(inside.trim()).filter(|name| !name.is_empty())
}

/// The unit of the horizontal axes.
fn unit(wkt: &str) -> Option<&'static str> {
    let upper = wkt.to_ascii_uppercase();
    // A compound system has the vertical one's unit behind.
    let end = ["VERT_CS", "VERTCRS", "VERT_DATUM"].iter().filter_map(|word| upper.find(word)).min();
    let horizontal = &wkt[..end.filter(|end| wkt.is_char_boundary(*end)).unwrap_or(wkt.len())];
    let upper = &upper[..horizontal.len()];
    let is_projected = upper.contains("PROJCS") || upper.contains("PROJCRS");
    let is_local =
        upper.contains("LOCAL_CS") || upper.contains("ENGCRS") || upper.contains("GEOCCS");
    if !is_projected && !is_local {
        let is_geographic = upper.contains("GEOGCS") || upper.contains("GEOGCRS");
        return is_geographic.then_some("°");
    }
    // The geographic system below has degrees, before the projected one's own unit.
    let place = upper.rfind("UNIT[")?;
    let name = quoted(horizontal.get(place..)?)?.to_ascii_lowercase();
    if name.starts_with("met") || name == "m" {
        Some("m")
    } else if name.contains("foot") || name.contains("feet") || name.contains("ft") {
        Some("ft")
    } else if name.starts_with("deg") {
        Some("°")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_and_unit_are_those_of_the_projected_system() {
        let utm = r#"PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84",UNIT["degree",0.0174]],PROJECTION["x"],UNIT["metre",1]]"#;
        let crs = Crs::of(Some(utm));
        assert_eq!((crs.title(), crs.unit), ("WGS 84 / UTM zone 33N", Some("m")));
        let compound =
            format!(r#"COMPD_CS["both",{},VERT_CS["NAVD88",UNIT["US survey foot",0.3]]]"#, utm);
        assert_eq!(Crs::of(Some(&compound)).unit, Some("m"));
        let feet = r#"PROJCS["Oregon",GEOGCS["NAD83",UNIT["degree",1]],UNIT["foot",0.3048]]"#;
        assert_eq!(Crs::of(Some(feet)).unit, Some("ft"));
        let degrees = r#"GEOGCS["WGS 84",UNIT["degree",0.0174]]"#;
        assert_eq!(Crs::of(Some(degrees)).unit, Some("°"));
    }

    #[test]
    fn what_is_no_system_has_no_name() {
        for text in [None, Some(""), Some("\""), Some("PROJCS[\"\"]"), Some("UNIT[é")] {
            let crs = Crs::of(text);
            assert_eq!((crs.name.clone(), crs.unit), (None, None), "{text:?}");
            assert!(!crs.title().is_empty());
        }
    }
}
