"""What a coupled run watches over: changes of state, collapse, mechanisms, the energy balance."""
