use toml::Value;

/// Returns the first key with different values; `None` if only comments or layout differ.
pub(super) fn first_difference(before: &str, now: &str) -> Option<String> {
    let [before, now] = [before, now].map(|text| text.parse::<toml::Table>().ok().map(Value::Table));
    value_difference("", &before?, &now?)
}

fn value_difference(key: &str, before: &Value, now: &Value) -> Option<String> {
    use Value::{Array, Table};
    if before == now {
        return None;
    }
    let within = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
    match (before, now) {
        (Table(before), Table(now)) => {
            let removed = before.iter().find(|(name, _)| !now.contains_key(*name));
            let new = now.iter().find(|(name, _)| !before.contains_key(*name));
            let changed =
                || before.iter().find_map(|(name, was)| value_difference(&within(name), was, now.get(name)?));
            match (changed(), removed, new) {
                (Some(difference), ..) => Some(difference),
                (None, Some((name, _)), _) => Some(format!("'{}' is missing now", within(name))),
                (None, None, Some((name, _))) => Some(format!("'{}' is new", within(name))),
                (None, None, None) => None,
            }
        }
        (Array(before), Array(now)) if before.len() == now.len() => {
            let pairs = before.iter().zip(now).enumerate();
            pairs.into_iter().find_map(|(k, (was, is))| value_difference(&format!("{key}[{k}]"), was, is))
        }
        (Array(before), Array(now)) => {
            Some(format!("'{key}' has {} entries there and {} now", before.len(), now.len()))
        }
        _ => {
            let [before, now] = [before, now].map(format_value);
            Some(format!("'{key}' is {before} there and {now} now"))
        }
    }
}

fn format_value(value: &Value) -> String {
    let text = match value {
        Value::String(text) => format!("'{text}'"),
        Value::Integer(number) => number.to_string(),
        Value::Float(number) => number.to_string(),
        Value::Boolean(is) => is.to_string(),
        _ => "of another type".to_owned(),
    };
    lazygrid_io::excerpt(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_different_key_is_named() {
        let scenario = "steps = 10\n[[species]]\nname = 'A'\nradius = 0.5\n[output]\nframes = ['xyz']\n";
        let differs = |from: &str, to: &str| first_difference(scenario, &scenario.replace(from, to));
        assert_eq!(differs("steps = 10", "steps = 20").as_deref(), Some("'steps' is 10 there and 20 now"));
        assert_eq!(differs("0.5", "0.25").as_deref(), Some("'species[0].radius' is 0.5 there and 0.25 now"));
        assert_eq!(differs("'A'", "'B'").as_deref(), Some("'species[0].name' is 'A' there and 'B' now"));
        assert_eq!(
            differs("['xyz']", "[]").as_deref(),
            Some("'output.frames' has 1 entries there and 0 now")
        );
        assert_eq!(differs("radius = 0.5", "").as_deref(), Some("'species[0].radius' is missing now"));
        assert_eq!(differs("radius", "mass = 1\nradius").as_deref(), Some("'species[0].mass' is new"));
        assert_eq!(differs("steps = 10", "steps = 10 # fewer"), None);
        assert_eq!(differs("steps = 10", "steps ="), None);
    }
}
