//! A table as CSV (RFC 4180 quoting): one line a row, numbers unrounded, the paper's in columns of their own.

use super::layout::{PROPOSALS, Part, Table};

/// For every column its value, the interval's ends and the paper's figure; empty = there is none.
pub fn csv(table: &Table) -> String {
    let mut head: Vec<String> = table.labels.iter().map(|label| label.key.to_string()).collect();
    head.extend(["status", "lineages"].map(String::from));
    for column in &table.columns {
        head.extend(["", "_low", "_high", "_paper"].map(|end| format!("{}{end}", column.key)));
    }
    head.extend(table.counts.iter().chain([&PROPOSALS]).map(|count| count.key.to_string()));
    head.push("notes".into());
    let mut out = line(&head);
    for row in table.printed().into_iter().flat_map(Part::printed) {
        let mut fields = row.labels.clone();
        fields.extend(["measured".to_string(), row.lineages.join(" ")]);
        for cell in &row.cells {
            let interval = cell.ours.and_then(|estimate| estimate.interval);
            let numbers = [cell.ours.map(|e| e.value), interval.map(|i| i[0]), interval.map(|i| i[1]), cell.paper];
            fields.extend(numbers.map(|number| number.map_or(String::new(), |x| x.to_string())));
        }
        fields.extend(row.counts.iter().map(usize::to_string));
        fields.extend([row.proposals.clone(), row.notes.join(" ")]);
        out.push_str(&line(&fields));
    }
    out
}

/// One line of fields, quoted where they need it.
pub fn line(fields: &[String]) -> String {
    let needs_quotes = |field: &str| field.contains([',', '"', '\n', '\r']);
    let quoted = |field: &String| {
        if needs_quotes(field) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.clone() }
    };
    format!("{}\n", fields.iter().map(quoted).collect::<Vec<_>>().join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_with_commas_quotes_and_line_breaks_are_quoted() {
        let fields = ["plain", "a,b", "say \"x\"", "two\nlines"].map(String::from);
        assert_eq!(line(&fields), "plain,\"a,b\",\"say \"\"x\"\"\",\"two\nlines\"\n");
    }
}
