/** Text of a TOML file: values, then tables of values and of inline tables. */

const BARE = /^[\w-]+$/;

const writeKey = (key) => (BARE.test(key) ? key : JSON.stringify(key));

const isTable = (value) => typeof value === "object" && !Array.isArray(value);

/** Return the entries that have a value. */
const list = (table) => Object.entries(table).filter(([, value]) => value !== null && value !== undefined);

function writeValue(value) {
  if (typeof value === "string" && value.includes("\n"))
    return `"""\n${value.replaceAll("\\", "\\\\").replaceAll('"""', '\\"\\"\\"')}"""`;
  if (Array.isArray(value)) return `[${value.map(writeValue).join(", ")}]`;
  if (!isTable(value)) return JSON.stringify(value);
  return `{ ${list(value).map(writeEntry).join(", ")} }`;
}

const writeEntry = ([key, value]) => `${writeKey(key)} = ${writeValue(value)}`;

/** Return the text of a document whose tables have values and inline tables. */
export function writeToml(document) {
  const entries = list(document);
  const tables = entries.filter(([, value]) => isTable(value) && list(value).length);
  return [
    entries.filter(([, value]) => !isTable(value)).map(writeEntry).join("\n"),
    ...tables.map(([name, table]) => `[${writeKey(name)}]\n${list(table).map(writeEntry).join("\n")}`),
  ].join("\n\n").concat("\n");
}
