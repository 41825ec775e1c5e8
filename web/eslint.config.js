// What the linter asks of the dashboard's sources: the strict rules of TypeScript with types, and Svelte's.
import js from "@eslint/js";
import svelte from "eslint-plugin-svelte";
import globals from "globals";
import ts from "typescript-eslint";
import config from "./svelte.config.js";

export default ts.config(
  { ignores: ["generated/", "dist/", "node_modules/"] },
  js.configs.recommended,
  ts.configs.strictTypeChecked,
  svelte.configs.recommended,
  {
    languageOptions: {
      globals: globals.browser,
      parserOptions: { projectService: true, extraFileExtensions: [".svelte"], tsconfigRootDir: import.meta.dirname },
    },
    rules: {
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true }],
      // Characters are taken apart where no emoji can be.
      "@typescript-eslint/no-misused-spread": "off",
      // What is reactive here is replaced as a whole.
      "svelte/prefer-svelte-reactivity": "off",
      // Addresses are fragments of this page; there is no other router.
      "svelte/no-navigation-without-resolve": "off",
    },
  },
  { files: ["**/*.svelte", "**/*.svelte.ts"], languageOptions: { parserOptions: { parser: ts.parser, svelteConfig: config } } },
  // Scripts that drive a browser are plain JavaScript.
  { files: ["**/*.mjs", "*.js"], ...ts.configs.disableTypeChecked },
  { files: ["**/*.mjs", "*.js"], languageOptions: { globals: globals.node } },
);
