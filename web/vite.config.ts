// Builds the dashboard into static files that the server embeds. No address of any other host.
import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig, loadEnv } from "vite";

export default defineConfig(({ mode }) => {
  // While it is worked on, the page asks a running service: MELANGE_URL=http://127.0.0.1:8080 npm run dev
  const service = loadEnv(mode, ".", "MELANGE_")["MELANGE_URL"] ?? "http://127.0.0.1:8080";
  return {
    plugins: [svelte()],
    base: "./",
    build: { target: "es2022", chunkSizeWarningLimit: 1000 },
    // To the service the page is then its own.
    server: { proxy: { "/api": { target: service, changeOrigin: true, headers: { origin: service } } } },
  };
});
