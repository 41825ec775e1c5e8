// Mounts the dashboard.
import { mount } from "svelte";
import App from "./App.svelte";
import "./style.css";

const target = document.getElementById("app");
if (!target) throw new Error("the page has no place for the dashboard");
export default mount(App, { target });

// The part that draws comes while the service is asked, not after.
void import("./chart/FigureBox.svelte");
