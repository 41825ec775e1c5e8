// Builds the dashboard into static files that the server embeds. No address of any other host.
import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vite";

export default defineConfig({
  plugins: [svelte()],
  base: "./",
  build: { target: "es2022", chunkSizeWarningLimit: 1000 },
});
