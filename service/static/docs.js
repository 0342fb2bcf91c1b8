/** The page of the interface: calls and types as `/openapi.json` has them. */

const BOUNDS = [
  ["minimum", "≥ "],
  ["exclusiveMinimum", "> "],
  ["maximum", "≤ "],
  ["exclusiveMaximum", "< "],
  ["minLength", "length ≥ "],
  ["maxLength", "length ≤ "],
  ["minItems", "items ≥ "],
  ["maxItems", "items ≤ "],
];

/** An element with attributes and children: elements, or text, which is never read as markup. */
function made(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

function entry(id, summary, ...content) {
  return made("details", { class: "entry", id }, made("summary", {}, ...summary), made("div", {}, ...content));
}

/** Text with what stands between backticks as code. */
function prose(text) {
  const parts = text.split("`").map((part, k) => (k % 2 ? made("code", {}, part) : part));
  return made("p", {}, ...parts);
}

const nameOf = (reference) => reference.split("/").at(-1);

/** The type of a value in words, its named parts as links. */
function typed(schema) {
  if (schema.$ref) return [made("a", { href: `#${nameOf(schema.$ref)}` }, nameOf(schema.$ref))];
  const choices = schema.anyOf ?? schema.oneOf ?? schema.allOf;
  if (choices) return choices.flatMap((choice, k) => (k ? [" or ", ...typed(choice)] : typed(choice)));
  if (schema.enum) return [schema.enum.map((value) => JSON.stringify(value)).join(" or ")];
  if ("const" in schema) return [JSON.stringify(schema.const)];
  if (schema.type === "array") {
    const places = schema.prefixItems;
    if (!places) return ["array of ", ...typed(schema.items ?? {})];
    return ["array of ", ...places.flatMap((place, k) => (k ? [", ", ...typed(place)] : typed(place)))];
  }
  const words = [[schema.type ?? "any"].flat().join(" or ")];
  if (schema.format || schema.contentMediaType) words.push(`(${schema.format ?? schema.contentMediaType})`);
  if (typeof schema.additionalProperties === "object") {
    return [`${words.join(" ")} of `, ...typed(schema.additionalProperties)];
  }
  return [words.join(" ")];
}

function bounds(schema) {
  const parts = [schema, ...(schema.anyOf ?? [])];
  const stated = parts.flatMap((part) => BOUNDS.filter(([key]) => key in part).map(([key, sign]) => sign + part[key]));
  if (schema.default !== undefined && schema.default !== null) stated.push(`default ${JSON.stringify(schema.default)}`);
  return stated.join(", ");
}

/** A table of `[name, required, schema, description]`. */
function table(rows) {
  const line = ([name, required, schema, description]) => {
    const notes = [description, bounds(schema)].filter(Boolean);
    return made(
      "tr",
      {},
      made("th", { scope: "row" }, made("code", {}, name), required ? " (required)" : ""),
      made("td", {}, ...typed(schema), ...notes.map((note) => prose(note))),
    );
  };
  return made("table", { class: "fields" }, made("tbody", {}, ...rows.map(line)));
}

function fields(schema) {
  const required = schema.required ?? [];
  const rows = Object.entries(schema.properties ?? {});
  return table(rows.map(([name, part]) => [name, required.includes(name), part, part.description]));
}

/** The content of a body or an answer: its kinds, each with its type. */
function contents(content = {}) {
  return Object.entries(content).map(([kind, { schema }]) => {
    const type = schema && Object.keys(schema).length ? [": ", ...typed(schema)] : [];
    return made("p", {}, made("code", {}, kind), ...type);
  });
}

function call(path, method, operation) {
  const parameters = (operation.parameters ?? []).map((one) => [
    `${one.name} (${one.in})`,
    one.required,
    one.schema ?? {},
    one.description,
  ]);
  const answers = Object.entries(operation.responses).map(([status, answer]) =>
    made(
      "tr",
      {},
      made("th", { scope: "row" }, made("code", {}, status)),
      made("td", {}, answer.description, ...contents(answer.content)),
    ),
  );
  return entry(
    operation.operationId,
    [made("code", {}, made("span", { class: "method" }, method.toUpperCase()), path), ` ${operation.summary ?? ""}`],
    ...(operation.description ? operation.description.split("\n\n").map(prose) : []),
    ...(parameters.length ? [made("h3", {}, "Parameters"), table(parameters)] : []),
    ...(operation.requestBody ? [made("h3", {}, "Body"), ...contents(operation.requestBody.content)] : []),
    made("h3", {}, "Answers"),
    made("table", { class: "fields" }, made("tbody", {}, ...answers)),
  );
}

/** Open what the address points at. */
function openTarget() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (target instanceof HTMLDetailsElement) {
    target.open = true;
    target.scrollIntoView();
  }
}

async function show() {
  const answer = await fetch("/openapi.json");
  if (!answer.ok) throw new Error(`the service answers ${answer.status}`);
  const { info, paths, components } = await answer.json();
  document.getElementById("summary").textContent = `${info.title} ${info.version}. ${info.summary ?? ""}`;
  const calls = Object.entries(paths).flatMap(([path, operations]) =>
    Object.entries(operations).map(([method, operation]) => call(path, method, operation)),
  );
  const types = Object.entries(components.schemas).map(([name, schema]) =>
    entry(name, [made("code", {}, name)], ...(schema.description ? [prose(schema.description)] : []), fields(schema)),
  );
  document.getElementById("calls").append(made("h2", {}, "Calls"), ...calls);
  document.getElementById("types").append(made("h2", {}, "Types"), ...types);
  document.getElementById("state").hidden = true;
  openTarget();
}

addEventListener("hashchange", openTarget);
show().catch((error) => {
  document.getElementById("state").textContent = `The description of the interface cannot be shown: ${error.message}`;
});
