// Mounts the dashboard.
import { mount } from "svelte";
import App from "./App.svelte";
import { PANELS } from "./panels/panels";
import { route } from "./view/route.svelte";
import "./style.css";

const target = document.getElementById("app");
if (!target) throw new Error("the page has no place for the dashboard");
export default mount(App, { target });

// The panel that the address names, or the one that most ensembles show first, comes while the service is asked.
const [place = "sweep", , panel = "laws"] = route.path;
if (place === "sweep") PANELS[panel]?.load().catch(() => undefined);
