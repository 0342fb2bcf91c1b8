/** The page of all calls: Swagger UI, which is loaded before, shows the interface description. */

const dark = matchMedia("(prefers-color-scheme: dark)");

function shade() {
  document.documentElement.classList.toggle("dark-mode", dark.matches);
}

const isJson = (schema) => schema?.get?.("contentMediaType") === "application/json";

/** Fields of JSON text are typed, where Swagger UI would ask for a file, and empty unless there is an example. */
const jsonFields = {
  afterLoad() {
    const { isFileUploadIntended, getSampleSchema } = this.fn;
    this.fn.isFileUploadIntended = (schema, ...more) => !isJson(schema) && isFileUploadIntended(schema, ...more);
    this.fn.getSampleSchema = (schema, ...more) =>
      isJson(schema) && !schema.has("examples") ? "" : getSampleSchema(schema, ...more);
  },
};

dark.addEventListener("change", shade);
shade();

SwaggerUIBundle({
  url: "/openapi.json",
  dom_id: "#calls",
  deepLinking: true, // an address for every call
  validatorUrl: null, // which would be told of the description
  plugins: [jsonFields],
});
