// Entry of the dashboard.
import { mount } from "svelte";
import App from "./App.svelte";
import "./style.css";

const target = document.getElementById("app");
if (!target) throw new Error("the page lacks its #app element");
export default mount(App, { target });
